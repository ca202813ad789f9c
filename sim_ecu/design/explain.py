"""`sim-ecu design --explain`: the rules of a design as sentences, with the data behind each."""

import json
from pathlib import Path

from wrcd.errors import InputError
from wrcd.estimator.design import load_design
from wrcd.tools.explain import bounds, sentence


def explain(file: Path) -> int:
    """Print the models, the sets, and the rules: those that most of the training data speaks for first."""
    design = load_design(file)
    document = json.loads(file.read_text(encoding="utf-8"))
    try:
        support = [float(s) for s in document["fuzzy"]["support"]]
        fit, plan = document["fit"], document["inputs"]["plan"]
    except (KeyError, TypeError, ValueError) as e:
        raise InputError(
            f"does not tell its data: {e!r}", file=file, hint="make it again with `sim-ecu design`"
        ) from None
    whole = sum(support)
    print(f"{design.name}, checksum {design.checksum[:12]}: {len(design.rules)} rules over {fit['windows']} windows of "
          f"{design.window_s:g} s (seed {plan['seed']}), mean error on them {fit['mean_error_pp']} pp")  # fmt: skip
    print("\nModels, and where each is linearised:")
    for k, m in enumerate(document["bank"]["models"]):
        c = m["curve"]
        print(f"  {k + 1}: {m['name']} (curve {c['name']}, mu_0 {c['mu_0']:.3g}, {m['creep_of_peak']:.3g} of the creep "
              f"at its peak)")  # fmt: skip
    print("\nThe middles of the sets; between two of them an input belongs to both:")
    for line in bounds(design):
        print(f"  {line}")
    print("\nRules. The outcome is their mean by weight; output 0 … 100 is converted to adhesion by the polynomial.")
    for r in sorted(range(len(support)), key=lambda r: -support[r]):
        low, high = design.typical_pct[r]
        print(f"{r + 1:3}. {sentence(design, r)}\n"
              f"     {support[r]:.0f} windows' worth ({100 * support[r] / whole:.1f} %), nine tenths of them at "
              f"{low:.3g} … {high:.3g} %; 90 % interval ± {100 * design.spreads[r]:.0f} % of the estimate")  # fmt: skip
    return 0
