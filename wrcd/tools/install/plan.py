"""What an installation would change: made by looking only, carried out by apply()."""

import re
from collections.abc import Collection
from dataclasses import dataclass, field

from wrcd.tools.install import manifest as manifests
from wrcd.tools.install import previous
from wrcd.tools.install.files import CONFIGURATIONS, LOCAL, Laid
from wrcd.tools.install.links import enabled_links
from wrcd.tools.install.manifest import Manifest
from wrcd.tools.install.tree import Tree

NEW, SAVED = ".wrcd-new", ".wrcd-saved"  # neither systemd nor sysctl reads files that end so, with -2, -3 ... or not
NUMBER = re.compile(r"-\d+$")
TEMPLATE = "@.service"


@dataclass(slots=True)
class Plan:
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
    links: dict[str, str] = field(default_factory=dict)  # enabled units: where their links are to point
    why: dict[str, str] = field(default_factory=dict)

    @property
    def changes(self) -> bool:
        """Whether there is anything to do."""
        return bool(self.add or self.change or self.remove or self.save or self.disable or self.beside or self.links)

    def touches(self, *folders: str) -> bool:
        """Whether a file in one of these folders, or below it, is written or removed."""
        paths = (*self.add, *self.change, *self.remove, *self.save)
        return any(path.startswith(f"{folder}/") for path in paths for folder in folders)


def make_plan(tree: Tree, wanted: dict[str, Laid], old: Manifest | None) -> Plan:
    """Compare what is to lie there with what lies there. wanted: by lay_out(). old: the record, if there is one."""
    plan = Plan()
    known = old or Manifest("", "", [])
    for path, laid in wanted.items():
        _place(plan, tree, known, path, laid)
    for path in sorted(set(known.files) - set(wanted)):
        _obsolete(plan, tree, known, path, wanted)
    for path in sorted(set(known.beside) - set(plan.beside)):
        if _edited(path) not in plan.keep and known.owns(path, tree.checksum(path)):
            plan.remove.append(path)
            plan.why[path] = "its edited file is as the new one by now"
    for path in previous.BY_HAND:
        if path not in wanted and path not in known.files:
            _by_hand(plan, tree, path, wanted)
    return plan


def _place(plan: Plan, tree: Tree, known: Manifest, path: str, laid: Laid) -> None:
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
    elif path not in known.files and previous.is_unmodified(path, there):
        plan.change[path] = laid
        plan.why[path] = "0.1.0, not edited: taken over"
    else:
        plan.keep.append(path)
        edited = path in known.files or path in previous.BY_HAND
        plan.why[path] = "edited here" if edited else "not installed by wrcd"
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


def _obsolete(plan: Plan, tree: Tree, known: Manifest, path: str, wanted: Collection[str]) -> None:
    """Decide what becomes of one path that was installed and is no longer part of it."""
    _end_units(plan, tree, path, wanted)
    there = tree.checksum(path)
    if there is None:
        return
    if known.owns(path, there):
        plan.remove.append(path)
    else:
        plan.save[path] = saved(tree, path)
        plan.why[path] = f"edited here: renamed to {plan.save[path].rpartition('/')[2]}"


def _end_units(plan: Plan, tree: Tree, path: str, wanted: Collection[str]) -> None:
    """Have the units of a template stopped and disabled, unless it is installed, if elsewhere."""
    name = path.rpartition("/")[2]
    if name.endswith(TEMPLATE) and f"{LOCAL.units}/{name}" not in wanted:
        plan.stop.append(name.replace("@", "@*"))
        plan.disable += enabled_links(tree, {f"/{path}"})


def _by_hand(plan: Plan, tree: Tree, path: str, wanted: Collection[str]) -> None:
    """Take a copy of 0.1.0 out of the way. An edited one stays, and hides the unit that is installed."""
    there = tree.checksum(path)
    if there is None:
        return
    name = path.rpartition("/")[2]
    if previous.is_unmodified(path, there):
        plan.remove.append(path)
        plan.why[path] = "0.1.0, not edited: taken over"
        _end_units(plan, tree, path, wanted)
        for link in enabled_links(tree, {f"/{path}"}) if f"{LOCAL.units}/{name}" in wanted else ():
            plan.links[link] = f"/{LOCAL.units}/{name}"
    else:
        plan.keep.append(path)
        plan.why[path] = (
            f"not installed by wrcd, and it hides /{LOCAL.units}/{name}: move your changes to a drop-in "
            f"(systemctl edit {name}), then remove it"
        )


def apply(tree: Tree, plan: Plan, record: Manifest, old: Manifest | None) -> None:
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
    manifests.write(tree, record)
    for path, laid in (written | plan.beside).items():
        record.folders += tree.make_folders(path)
        tree.write(path, laid)
    for link, target in plan.links.items():
        tree.write(link, Laid(target=target))
    for path, to in plan.save.items():
        tree.rename(path, to)
    for path in (*plan.disable, *plan.remove):
        tree.remove(path)
    tree.remove_empty(sorted({path.rpartition("/")[0] for path in plan.disable}))
    record.files, record.beside = files, beside
    tree.remove_empty([f for f in record.folders if not _used(f, record)])
    record.folders = sorted(f for f in set(record.folders) if tree.path(f).is_dir())
    manifests.write(tree, record)


def _left(plan: Plan, tree: Tree, known: Manifest) -> dict[str, list[str]]:
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
        p.startswith(f"{folder}/") for p in (*record.files, *record.beside, manifests.PATH, CONFIGURATIONS)
    )
