"""Errors of a DVL that a filter assumes, of a replay or live."""

from bottomlock import units
from bottomlock.config.scenario_sections import NonNegative, Section
from bottomlock.kernel import models


class DvlErrors(Section):
    """Errors of the DVL that the filter assumes beside the beams' white noise, 1 sigma."""

    beam_bias_mps: NonNegative = 0.005
    beam_bias_walk_mps_per_rt_s: NonNegative = 5e-5
    scale_factor_percent: NonNegative = 0.7
    scale_factor_walk_percent_per_rt_s: NonNegative = 5e-3

    def kernel_model(self, beam_noise_sd_mps: float) -> models.DvlModel:
        """The errors in SI, with the noise of a beam."""
        return models.DvlModel(
            beam_noise_sd_mps=beam_noise_sd_mps,
            beam_bias_sd_mps=self.beam_bias_mps,
            beam_bias_walk_mps_rts=self.beam_bias_walk_mps_per_rt_s,
            scale_factor_sd=units.fraction_from_percent(self.scale_factor_percent),
            scale_factor_walk_rts=units.fraction_from_percent(self.scale_factor_walk_percent_per_rt_s),
        )
