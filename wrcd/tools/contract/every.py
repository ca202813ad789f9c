"""All checks, in the order in which they are played."""

from wrcd.tools.contract import arriving, following, saying

CHECKS = (*saying.CHECKS, *arriving.CHECKS, *following.CHECKS)
