"""Names of forms, senses and alignments of an attitude, as options and functions take them."""

#: Forms of a written attitude, orders of a quaternion, and what it turns.
FORMS = ("state", "rpy", "quaternion", "matrix", "rotation-vector")
QUATERNIONS = ("xyzs", "sxyz")
SENSES = ("body-to-reference", "reference-to-body")
#: Level axes: north, east, down, and east, north, up.
LEVEL_AXES = ("ned", "enu")
#: Formats of a trajectory: of the TUM RGB-D and the KITTI benchmark.
TRAJECTORIES = ("tum", "kitti")
#: Ways of turning the axes of a computed attitude before its error is taken, and what each does.
ALIGNMENTS = {
    "start": "reference axes turned so that both attitudes are equal at the first instant",
    "none": "frames as they are",
    "mean": "reference axes turned so that the attitudes agree best over the run",
    "mounting": "body and reference axes turned so that the turns and the attitudes agree best over the run",
}
