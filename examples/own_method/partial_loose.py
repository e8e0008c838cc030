"""A method of one's own: the platform components that the valid beams determine, as the built-in plcf.

bottomlock run straight --methods plcf,examples/own_method/partial_loose.py:PartialLoose --runs 20 --out out/own_method
"""

import numpy as np

from bottomlock.own_method import Beams, Prior, Rows


class PartialLoose:
    """Least squares on the beams; a component is used if it lies in the space of their directions."""

    name = "my_partial_loose"

    def ping(self, beams: Beams, prior: Prior) -> Rows | None:
        """Rows of the components that are observed; none without beams."""
        directions, weights = beams.directions_p, np.linalg.inv(beams.cov_m2ps2)
        information = directions.T @ weights @ directions
        inverse = np.linalg.pinv(information, rcond=1e-9, hermitian=True)
        observed = np.abs(np.diag(inverse @ information) - 1.0) < 1e-6
        if not observed.any():
            return None
        return beams.through((inverse @ directions.T @ weights)[observed])
