"""One of the policies of a run, and what it has done."""

import dataclasses

from fetch_composer import policies
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.pictures.film import Film


@dataclasses.dataclass
class Candidate:
    """One of the policies of a run, and what it has done.

    Attributes:
        policy: Its name.
        key: A name for its folder, which no other policy of the run has.
        is_alone: Whether it is the run's only one.
        make_policy: Makes it for a seed; it has been seen to act.
        episodes: The finished episodes, by seed.
        films: Films by the index of their episode, those to look at first at the front.
    """

    policy: str
    key: str
    is_alone: bool
    make_policy: policies.PolicyFactory
    episodes: list[Episode] = dataclasses.field(default_factory=list)
    films: dict[int, Film] = dataclasses.field(default_factory=dict)

    def path(self, name: str) -> str:
        """Returns the path of one of its files within the run's folder."""
        return name if self.is_alone else f'{self.key}/{name}'

    def film_path(self, index: int) -> str:
        """Returns the path of the film of an episode within the run's folder."""
        return self.path(f'episode_{index:03d}.mp4')
