"""Prefixes and suffixes that the joints of a file share, and that are no part of their names.

Exporters put the name of the character before every joint's: `mixamorig:Hips`, `mixamorigHips`,
`Character1_Hips`, `Bip001 Pelvis`, `scene:robot:Hips`; some put `_jnt` or ` (1)` behind. A prefix
is what many joints begin with, and it counts only where more joints are recognised without it: a
name that merely begins like others keeps all of its letters.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

# After a separator, after a digit, before a capital: where a name may start behind its prefix.
_STARTS = re.compile(r"(?<=[\W_])(?=[^\W_])|(?<=[a-z0-9])(?=[A-Z])|(?<=\d)(?=[^\W\d_])|$")
_ENDS = re.compile(r"[\W_]+\w+\W*$")  # the last word, with what separates it
_LONGEST = 80  # characters of a prefix
_MOST = 20  # prefixes, and suffixes, that are tried


def without_prefix(names: Sequence[str], least: int) -> list[list[str]]:
    """The names as they are, then without each prefix or suffix that `least` of them share.

    The shorter prefixes come first, suffixes last. A joint that has not the prefix keeps its name,
    and one that is called as the prefix has an empty one.
    """
    shared = Counter(
        name[: match.start()] for name in names for match in _STARTS.finditer(name, 1, _LONGEST)
    )
    first, last = min(names, default=""), max(names, default="")
    common = next((first[:k] for k in range(len(first)) if first[k] != last[k : k + 1]), first)
    found = {prefix for prefix, count in shared.most_common(_MOST) if count >= least}
    if common and len(names) >= least:
        found.add(common)
    ordered = sorted(found, key=lambda prefix: (len(prefix), prefix))
    ends = Counter(match.group() for name in names if (match := _ENDS.search(name[-_LONGEST:])))
    return [
        list(names),
        *([name.removeprefix(prefix) for name in names] for prefix in ordered),
        *(
            [name.removesuffix(end) for name in names]
            for end, count in ends.most_common(_MOST)
            if count >= least
        ),
    ]
