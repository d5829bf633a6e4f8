"""What is to be recorded."""

from __future__ import annotations

from typing import ClassVar

from ._document import Document
from ._json import children, number, text


class Plan(Document):
    """Records that are to be made, on a simulated motor or on a stand: the file `plan.toml`.

    >>> step = {"nominal": 0.5, "excitation": "step", "amplitude": 0.05, "hold_s": 0.5}
    >>> Plan.from_dict({"name": "a step", "seed": 1, "record": [step]})
    <rotorlead.Plan 'a step': step at 0.5>
    """

    _kind: ClassVar[str] = "plan"

    @property
    def name(self) -> str:
        """What the experiment is called."""
        return text(self._keys, "name")

    def __repr__(self) -> str:
        records = children(self._keys, "record")
        said = ", ".join(f"{text(record, 'excitation')} at {number(record, 'nominal'):g}" for record in records)
        return f"<rotorlead.Plan {self.name!r}: {said}>"
