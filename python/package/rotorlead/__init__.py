"""Identification, design, diagnosis and simulation of motors with their propellers, as the command `rotorlead` does it.

>>> import rotorlead
>>> found = rotorlead.identify("stand")                                 # doctest: +SKIP
>>> lead = rotorlead.design(found.model)                                # doctest: +SKIP
"""

from ._answer import Answer, AnswerTable
from ._compensator import Compensator, FrequencyResponse
from ._figure import Figure
from ._functions import (
    Bandwidth,
    Design,
    Diagnosis,
    Effect,
    EscRamp,
    Export,
    ExportedParameter,
    Gap,
    Identification,
    Parameter,
    Ramp,
    ReplayedRecord,
    Report,
    Validation,
    bandwidth,
    design,
    diagnose,
    export,
    identify,
    report,
    simulate,
    validate,
)
from ._model import Judgement, Lag, Model
from ._native import Error, __version__
from ._plan import Plan
from ._records import Record, Records

__all__ = [
    "Answer",
    "AnswerTable",
    "Bandwidth",
    "Compensator",
    "Design",
    "Diagnosis",
    "Effect",
    "Error",
    "EscRamp",
    "Export",
    "ExportedParameter",
    "Figure",
    "FrequencyResponse",
    "Gap",
    "Identification",
    "Judgement",
    "Lag",
    "Model",
    "Parameter",
    "Plan",
    "Ramp",
    "Record",
    "Records",
    "ReplayedRecord",
    "Report",
    "Validation",
    "__version__",
    "bandwidth",
    "design",
    "diagnose",
    "export",
    "identify",
    "report",
    "simulate",
    "validate",
]
