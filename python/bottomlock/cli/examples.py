"""Examples for the `--help` of each command; a test parses every one."""

NAME = "bottomlock"

EXAMPLES = {
    "run": (
        "run straight -o out/first",
        "run straight lawn_mower -o out/pair -n 500 -m tc,nsv,sway_current",
        "run straight -o out/gyros --set imu.gyro_bias_deg_per_h=0.01,3,50",
    ),
    "fly": ("fly straight -o out/path",),
    "simulate-dvl": ("simulate-dvl survey --dvl tcpin:127.0.0.1:16171",),
    "keys": ("keys scenario gyro", "keys case --json", "keys scenario --schema"),
    "list": ("list geometries", "list scenarios --copy straight --out mine.toml"),
    "fix": ("fix beams.parquet", "fix beams.parquet --geometry waterlinked_a50 --leave-out 1"),
    "reproduce": ("reproduce -o out/paper -n 50",),
    "report": ("report out/first", "report out/a out/b -o out/both", "report out/gyros"),
    "study": (
        "study straight -o out/masks -n 100 -m tc,nsv,sway_current",
        "study straight -o out/depth --masks 12,1 --sensors none,depth",
    ),
    "look": ("look dive.pd0 imu.csv depth.csv",),
    "replay": ("replay case.toml", "replay case.toml -o out/dive"),
    "tune": ("tune case.toml", "tune case.toml -o tuned.toml --fraction 0.4"),
    "audit": ("audit beams.parquet", "audit beams.parquet -o out/audit --geometry waterlinked_a50"),
    "observe": ("observe straight -o out/states", "observe --paper -o out/paper_states"),
    "convert": ("convert dive.pd0", "convert dive.pd0 --out beams.parquet"),
    "live": ("live live.toml", "live live.toml --replay logs/LOG.mcap --export mcap,csv"),
    "live-demo": ("live-demo",),
    "live-setup": ("live-setup vehicle", "live-setup vehicle --host 0.0.0.0"),
}
"""By command, without the program's name."""


def epilogue(command: str) -> str:
    """The last lines of a command's help."""
    # Two spaces at the end of a line keep its break.
    return "Examples:  \n" + "  \n".join(f"{NAME} {example}" for example in EXAMPLES[command])
