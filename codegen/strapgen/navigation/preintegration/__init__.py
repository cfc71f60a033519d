"""Preintegration of stamped samples between any two instants, in Python and as a C++ header."""

#: What samples are: increments since the stamp before, rates that are their means, or rates at the stamps.
INPUTS = ("increments", "rates", "instants")
#: Kernel of the part of a sample, or of an interval, by the polynomial through those around it, by input.
INTERPOLATION = {
    "increments": "interpolated-integral",
    "rates": "interpolated-integral",
    "instants": "interpolated-mean",
}
#: Instants of a polynomial: at 1 rad a sample it is off by 1e-6 of the rate half an interval from an instant.
POINTS = 16
#: Pairs of instants near the ends of a recording, where fewer are on one side: more of them would amplify noise.
FEWEST = 3
#: Instants without a sample are so far away, in intervals, and as much more by their place: too far to count.
AWAY = 2.0**60
