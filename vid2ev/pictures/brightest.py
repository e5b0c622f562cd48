"""The greatest light of pictures: what infinite light counts as where it is mixed with other light."""

MOST_OF_HALF_FLOATS = 65504.0  # of IEEE 754 binary16, in which EXR keeps pictures
