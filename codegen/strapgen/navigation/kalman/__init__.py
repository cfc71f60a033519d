"""Kalman filters described in a file: analysed exactly, and generated as kernels."""

#: Kinds of gains, and forms of the covariance.
KINDS = {
    "steady": "one gain, of the algebraic Riccati equation",
    "scheduled": "gains of every step, computed before",
    "online": "gains of the covariance, which the filter computes",
}
FORMS = {"joseph": "covariance, updated in Joseph's form", "ud": "factors U D U', by Bierman and Thornton"}
