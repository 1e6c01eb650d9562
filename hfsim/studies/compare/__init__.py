"""Several models of one scene held against a reference model: differences and the verdict.

Two errors in time stand in the way of a verdict on models: that of the model and that of the reference.
Both are measured, by a looser run of each, and taken out of the difference; where nothing is left, the
models are equal as far as can be told.  What differences are divided by, and which of them count, is said in
`hfsim.marching.distance`.

Nothing is printed or written here.
"""

from hfsim.studies.compare.choice import (
    ChoiceError,
    Prepared,
    chosen_models,
    prepare,
    usual_models,
    without_blind_channels,
)
from hfsim.studies.compare.difference import Difference
from hfsim.studies.compare.judge import compare
from hfsim.studies.compare.measurements import Measured, coordinates_of, measure
from hfsim.studies.compare.result import Comparison, ModelResult, as_facts
from hfsim.studies.compare.study import carry_out
from hfsim.studies.compare.words import percent

__all__ = [
    "ChoiceError", "Comparison", "Difference", "Measured", "ModelResult", "Prepared", "as_facts", "carry_out",
    "chosen_models", "compare", "coordinates_of", "measure", "percent", "prepare",
    "usual_models", "without_blind_channels",
]  # fmt: skip
