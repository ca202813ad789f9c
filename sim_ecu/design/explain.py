"""`sim-ecu design --explain`: the rules of a design as sentences, with the data behind each."""

from pathlib import Path

from sim_ecu.design.source import load_source
from wrcd.tools.explain import GLOSSARY, bounds, sentence


def explain(file: Path) -> int:
    """Print the models, the sets, and the rules: those that most of the training data speaks for first."""
    source = load_source(file)
    design, support = source.design, source.support
    whole = sum(support)
    print(f"{design.name}, checksum {design.checksum[:12]}: {len(design.rules)} rules over {source.windows} windows of "
          f"{design.window_s:g} s (seed {source.seed}), mean error on them {source.mean_error_pp} pp")  # fmt: skip
    print("\nModels, and where each is linearised:")
    for k, p in enumerate(source.points):
        print(f"  {k + 1}: {p.name} (curve {p.curve.name}, mu_0 {p.curve.mu_0:.3g}, {p.creep_of_peak:.3g} of the creep "
              f"at its peak)")  # fmt: skip
    print("\nThe middles of the sets; between two of them an input belongs to both:")
    for line in bounds(design):
        print(f"  {line}")
    if design.slopes.any():
        print("\nWhat the outputs move with, besides:")
        for line in GLOSSARY:
            print(f"  {line}")
    print("\nRules. The outcome is their mean by weight; output 0 … 100 is converted to adhesion by the polynomial.")
    for r in sorted(range(len(support)), key=lambda r: -support[r]):
        low, high = design.typical_pct[r]
        print(f"{r + 1:3}. {sentence(design, r)}\n"
              f"     {support[r]:.0f} windows' worth ({100 * support[r] / whole:.1f} %), nine tenths of them at "
              f"{low:.3g} … {high:.3g} %; 90 % interval ± {100 * design.spreads[r]:.0f} % of the estimate")  # fmt: skip
    return 0
