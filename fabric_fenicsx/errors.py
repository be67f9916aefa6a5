"""The errors a user can meet; each message is one sentence: what, where, and what to do about it."""


class InputError(ValueError):
    """Something that was given (a fabric, a mesh, an option) cannot be used."""


class StepFailed(RuntimeError):
    """A load step could not be solved, not even in its smallest part; raised on every rank alike."""


class LawFailed(RuntimeError):
    """A law raised an error in the middle of a run; raised on every rank alike."""
