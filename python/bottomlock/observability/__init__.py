"""What can be estimated along a motion with given beams and sensors: Klein & Diamant 2015 and beyond."""
