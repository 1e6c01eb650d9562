"""How far a run can be trusted: validity of models, causes of failures, changes of model."""
