"""What was run and how it went, in one line."""

from fetch_composer.explorer.results import summary
from fetch_composer.explorer.results.candidate import Candidate
from fetch_composer.explorer.results.setting import Setting


def title(candidate: Candidate, setting: Setting) -> str:
    """Returns the title of a picture about a policy's episodes."""
    reached = sum(episode.is_success for episode in candidate.episodes)
    return (
        f'{setting.task_name} · {candidate.policy} · {setting.convention}: '
        f'{reached} of {len(candidate.episodes)} end at the goal'
    )


def result(candidate: Candidate) -> str:
    """Returns the figures of a policy's episodes, of which there is one or more."""
    figures = summary.summarize(candidate.episodes)
    distance_cm = 100 * figures['final_distance_m']['mean']
    return (
        ('' if candidate.is_alone else f'{candidate.policy}: ')
        + f'At the goal at the last step: {100 * figures["success_rate"]:.1f} % of '
        f'{len(candidate.episodes)}; mean distance {distance_cm:.1f} cm; '
        f'mean return {figures["return"]["mean"]:.4g}; '
        f'{figures["control_steps_per_second"]:.0f} control steps/s in the environment.'
    )
