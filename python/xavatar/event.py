"""What callbacks of long work are told."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Event:
    """Something that happened in ``train``, ``register`` or ``evaluate``."""

    #: In ``train``: ``"preparing"``, ``"step"``, ``"refining"``, ``"refined"``, ``"checkpoint"``, ``"preview"``. In ``evaluate``: ``"measured"``. In
    #: ``register``: the phase, such as ``"starts"``, ``"shape"``, ``"frames"``.
    kind: str
    #: The share of the work that is done, 0 to 1; 0 for checkpoints and previews.
    progress: float
    #: Of a step: ``"pretraining"`` or ``"frames"``.
    stage: str | None = None
    #: Steps done in this stage.
    step: int | None = None
    #: Of a step: the loss terms, unweighted, and their weighted sum ``"total"``.
    losses: dict[str, float] = field(default_factory=dict)
    #: Of a checkpoint or a preview: the file.
    path: Path | None = None
    #: Which frame, what is done, or what refining the poses did.
    message: str | None = None
