"""Settings of the flow as arguments of a command line."""

import argparse

from flow.estimation import estimate
from flow.warping import warp


def add(parser, methods=estimate.METHODS):
    """Add --method, one of these, --match-blur, --blur-by, --kernel, --tolerance-px."""
    parser.add_argument("--method", choices=methods, default=estimate.DEFAULT)
    parser.add_argument(
        "--match-blur",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="blur the photo as the render is, for the flow only",
    )
    parser.add_argument(
        "--blur-by",
        choices=estimate.METHODS,
        help="estimator of the flow by which the blur is found (default: method)",
    )
    parser.add_argument("--kernel", choices=warp.KERNELS, default="lanczos")
    parser.add_argument("--tolerance-px", type=float, default=1.0)
