"""What was tried, and how it went."""

import dataclasses


@dataclasses.dataclass
class Tally:
    """Counts of one kind of hostility.

    Attributes:
        tried: How often it was tried.
        refused: How often it was refused with an error that names the fault.
        defects: What was neither refused so nor done right, a text each.
    """

    tried: int = 0
    refused: int = 0
    defects: list[str] = dataclasses.field(default_factory=list)

    def add(self, was_refused: bool) -> None:
        """Counts a trial that went as promised."""
        self.tried += 1
        self.refused += was_refused
