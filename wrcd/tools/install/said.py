"""What an installation or a removal says: one line a file that a person may want to know of."""

from collections.abc import Iterator

from wrcd.tools.install.plan import Plan


def line(what: str, path: str, why: str = "") -> str:
    """One file: what becomes of it, where it is, and why."""
    return f"  {what:<10} /{path}{': ' + why if why else ''}"


def describe(plan: Plan) -> Iterator[str]:
    """Every file that is added, changed, removed or kept; the others are counted."""
    for what, paths in (
        ("new", plan.add), ("changed", plan.change), ("removed", plan.remove), ("saved", plan.save),
        ("kept", plan.keep), ("beside", plan.beside),
    ):  # fmt: skip
        yield from (line(what, path, plan.why.get(path, "")) for path in sorted(paths))
    yield from (line("disabled", link) for link in sorted(plan.disable))
    yield from (line("enabled", link, f"now {target}") for link, target in sorted(plan.links.items()))
    if plan.unchanged:
        yield f"  unchanged  {len(plan.unchanged)} files"
    if plan.add or plan.change:
        yield "  no user is made: the units run as dynamic users (DynamicUser=yes)"
