"""Where an instrument sends its bytes: it listens on TCP, sends datagrams, or writes to a line or a file."""

from bottomlock.errors import OutputError
from bottomlock.ports.address import Address, Kind, forms
from bottomlock.ports.address import parse_address as parse

KINDS: tuple[Kind, ...] = ("tcpin", "udpout", "pty", "serial", "file")
EXPECTED = forms(KINDS)


def parse_address(text: str, option: str) -> Address:
    """The address in a command's option.

    Raises:
        OutputError: naming the option, for what is none of the forms.

    >>> parse_address("tcpin:16171", "--dvl")
    Address(kind='tcpin', host='127.0.0.1', port=16171, path='', baud=0)
    """
    try:
        return parse(text, KINDS, what="where an instrument sends", any_port=True)
    except ValueError as error:
        raise OutputError(error, place=option) from error
