"""Studies over many campaigns: methods by beams and sensors, the sweep, the whole of the 2017 paper."""
