"""What an installation would change: made by looking only, shown by describe(), carried out by apply()."""

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from wrcd.cli.installation.lay_out import CONFIGURATIONS, LOCAL, Laid
from wrcd.cli.installation.tree import RECORD, Manifest, Tree, enabled_links, write_manifest

NEW, SAVED = ".wrcd-new", ".wrcd-saved"  # neither systemd nor sysctl reads files that end so, with -2, -3 ... or not
NUMBER = re.compile(r"-\d+$")
TEMPLATE = "@.service"


@dataclass(slots=True)
class InstallationPlan:
    """Paths from the root on, by what becomes of them; why: words on those that a person should look at."""

    add: dict[str, Laid] = field(default_factory=dict)
    change: dict[str, Laid] = field(default_factory=dict)
    remove: list[str] = field(default_factory=list)
    save: dict[str, str] = field(default_factory=dict)  # no longer part of it, but edited: renamed to what
    disable: list[str] = field(default_factory=list)  # links that would start units that are no longer part of it
    stop: list[str] = field(default_factory=list)  # patterns of these units
    keep: list[str] = field(default_factory=list)  # edited, or somebody else's
    unchanged: list[str] = field(default_factory=list)
    beside: dict[str, Laid] = field(default_factory=dict)  # the new file beside an edited one
    why: dict[str, str] = field(default_factory=dict)

    @property
    def changes(self) -> bool:
        """Whether there is anything to do."""
        return bool(self.add or self.change or self.remove or self.save or self.disable or self.beside)

    def touches(self, *folders: str) -> bool:
        """Whether a file in one of these folders, or below it, is written or removed."""
        paths = (*self.add, *self.change, *self.remove, *self.save)
        return any(path.startswith(f"{folder}/") for path in paths for folder in folders)


def make_plan(tree: Tree, wanted: dict[str, Laid], old: Manifest | None) -> InstallationPlan:
    """Compare what is to lie there with what lies there. wanted: by lay_out(). old: the record, if there is one."""
    plan = InstallationPlan()
    known = old or Manifest("", "", [])
    for path, laid in wanted.items():
        _place(plan, tree, known, path, laid)
    for path in sorted(set(known.files) - set(wanted)):
        _obsolete(plan, tree, known, path, wanted)
    for path in sorted(set(known.beside) - set(plan.beside)):
        if _edited(path) not in plan.keep and known.owns(path, tree.checksum(path)):
            plan.remove.append(path)
            plan.why[path] = "its edited file is as the new one by now"
    return plan


def _place(plan: InstallationPlan, tree: Tree, known: Manifest, path: str, laid: Laid) -> None:
    """Decide what becomes of one path that is wanted."""
    there = tree.checksum(path)
    if there is None:
        plan.add[path] = laid
        if path in known.files:
            plan.why[path] = "was missing"
    elif there == laid.checksum:
        plan.unchanged.append(path)
    elif known.owns(path, there):
        plan.change[path] = laid
    else:
        plan.keep.append(path)
        plan.why[path] = "edited here" if path in known.files else "not installed by wrcd"
        offered = [checksum for b, sums in known.beside.items() if _edited(b) == path for checksum in sums]
        if not laid.target and laid.checksum not in (*known.files.get(path, ()), *offered):
            new = tree.free(path + NEW, lambda name: known.owns(name, tree.checksum(name)))
            plan.beside[new] = laid
            plan.why[path] += f"; the new one is {new.rpartition('/')[2]}"


def _edited(beside: str) -> str:
    """The edited file beside which a new one waits."""
    return NUMBER.sub("", beside).removesuffix(NEW)


def saved(tree: Tree, path: str) -> str:
    """The name that an edited file gets, free of those that were edited before."""
    return tree.free(path + SAVED)


def _obsolete(plan: InstallationPlan, tree: Tree, known: Manifest, path: str, wanted: Collection[str]) -> None:
    """Decide what becomes of one path that was installed and is no longer part of it."""
    name = path.rpartition("/")[2]
    if name.endswith(TEMPLATE) and f"{LOCAL.units}/{name}" not in wanted:
        plan.stop.append(name.replace("@", "@*"))
        plan.disable += enabled_links(tree, {f"/{path}"})
    there = tree.checksum(path)
    if there is None:
        return
    if known.owns(path, there):
        plan.remove.append(path)
    else:
        plan.save[path] = saved(tree, path)
        plan.why[path] = f"edited here: renamed to {plan.save[path].rpartition('/')[2]}"


def line(what: str, path: str, why: str = "") -> str:
    """One file: what becomes of it, where it is, and why."""
    return f"  {what:<10} /{path}{': ' + why if why else ''}"


def describe(plan: InstallationPlan) -> Iterator[str]:
    """Every file that is added, changed, removed or kept; the others are counted."""
    for what, paths in (
        ("new", plan.add), ("changed", plan.change), ("removed", plan.remove), ("saved", plan.save),
        ("kept", plan.keep), ("beside", plan.beside),
    ):  # fmt: skip
        yield from (line(what, path, plan.why.get(path, "")) for path in sorted(paths))
    yield from (line("disabled", link) for link in sorted(plan.disable))
    if plan.unchanged:
        yield f"  unchanged  {len(plan.unchanged)} files"
    if plan.add or plan.change:
        yield "  no user is made: the units run as dynamic users (DynamicUser=yes)"


def apply(tree: Tree, plan: InstallationPlan, record: Manifest, old: Manifest | None) -> None:
    """Carry a plan out, and write the record.

    What is cut off on the way is completed by the next installation: from the beginning on the record knows the old
    files and the new ones, and at the end the new ones only.
    """
    known = old or Manifest("", "", [])
    written = plan.add | plan.change
    files = {path: [laid.checksum] for path, laid in written.items()} | _left(plan, tree, known)
    beside = {path: known.beside[path] for path in known.beside if _edited(path) in plan.keep}
    beside |= {path: [laid.checksum] for path, laid in plan.beside.items()}

    taken = {path: [tree.checksum(path) or ""] for path in plan.change}
    record.files, record.beside = _merged(known.files, taken, files), _merged(known.beside, beside)
    record.folders = sorted({*record.folders, *known.folders})
    write_manifest(tree, record)
    for path, laid in (written | plan.beside).items():
        record.folders += tree.make_folders(path)
        tree.write(path, laid)
    for path, to in plan.save.items():
        tree.rename(path, to)
    for path in (*plan.disable, *plan.remove):
        tree.remove(path)
    tree.remove_empty(sorted({path.rpartition("/")[0] for path in plan.disable}))
    record.files, record.beside = files, beside
    tree.remove_empty([f for f in record.folders if not _used(f, record)])
    record.folders = sorted(f for f in set(record.folders) if tree.path(f).is_dir())
    write_manifest(tree, record)


def _left(plan: InstallationPlan, tree: Tree, known: Manifest) -> dict[str, list[str]]:
    """What the record says of files that are not written.

    Of an edited one it has the checksum that was last offered, so that the same is not offered again.
    """
    unchanged = {path: [tree.checksum(path) or ""] for path in plan.unchanged}
    edited = {path: known.files[path] for path in plan.keep if path in known.files}
    offered = {_edited(p): [laid.checksum] for p, laid in plan.beside.items()}
    return unchanged | {path: offered.get(path, sums) for path, sums in edited.items()}


def _merged(*records: dict[str, list[str]]) -> dict[str, list[str]]:
    merged: dict[str, list[str]] = {}
    for record in records:
        for path, sums in record.items():
            merged[path] = list(dict.fromkeys([*merged.get(path, ()), *sums]))
    return merged


def _used(folder: str, record: Manifest) -> bool:
    return folder == CONFIGURATIONS or any(
        p.startswith(f"{folder}/") for p in (*record.files, *record.beside, RECORD, CONFIGURATIONS)
    )
