"""Keys of a campaign's file: one declaration each, for its reader and the docs."""

import math

from wrcd.keys import Choice, Flag, Key, Number, Text, Whole

FULL, RANDOM, LATIN = "full", "random", "latin"
METHODS = (FULL, RANDOM, LATIN)
MAX_POINTS, MAX_SEEDS, MAX_STEPS = 1_000_000, 1_000_000, 1_000_000
MAX_SEED = 4_000_000_000  # beyond any that a run is given by hand; the rig takes all from 0 on
MIN_LIMIT_S, MAX_LIMIT_S = 0.1, 1e6

TITLE = Text("title", "one line, for summary and comparison; default: the file's name")
KIND = Text("kind", "the kind of job, see below", needed=True)
METHOD = Choice(
    "method", "which points: `full` all combinations of the factors, `random` each drawn by itself, `latin` a Latin "
    "hypercube: every factor's values spread evenly", METHODS, FULL,
)  # fmt: skip
POINTS = Whole("points", "how many points `random` and `latin` draw; not of `full`", 1, MAX_POINTS)
DRAW = Whole(
    "draw", "which ones those are: another number draws others, whatever the seeds; not of `full`", 0, MAX_SEED, 1
)
SEEDS = Whole("seeds", "runs of each point, each with a seed of its own", 1, MAX_SEEDS, 1)
FIRST_SEED = Whole(
    "first_seed", "the seed of a point's first run; the next have the next. The points stay the same", 0, MAX_SEED, 1
)
LIMIT = Number("limit_s", "a job that takes longer, in seconds, is ended and said", MIN_LIMIT_S, MAX_LIMIT_S)
HEAD: tuple[Key, ...] = (TITLE, KIND, METHOD, POINTS, DRAW, SEEDS, FIRST_SEED, LIMIT)

LOW = Number("from", "the first value", -math.inf, math.inf)
HIGH = Number("to", "the last value", -math.inf, math.inf)
STEPS = Whole("steps", "needed with `full`: how many values, both ends among them", 2, MAX_STEPS)
LOG = Flag("log", "evenly by their logarithm", False)
WHOLE = Flag("whole", "whole numbers; a factor that takes whole numbers has no others", False)
RANGE: tuple[Key, ...] = (LOW, HIGH, STEPS, LOG, WHOLE)
