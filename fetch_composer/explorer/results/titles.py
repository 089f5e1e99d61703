"""What was run and how it went, in few words."""

from fetch_composer.explorer.results import summary
from fetch_composer.explorer.results.candidate import Candidate
from fetch_composer.explorer.results.setting import Setting
from fetch_composer.tasks import action_modes

_LONGEST_POLICY = 28


def title(candidate: Candidate, setting: Setting) -> str:
    """Returns the title of a picture about a policy's episodes."""
    reached = sum(episode.is_success for episode in candidate.episodes)
    mode = setting.identity.action_mode
    way = '' if mode == action_modes.DISPLACEMENT.name else f', {mode}'
    way += '' if setting.object_shape is None else f', {setting.object_shape}'
    return (
        f'{setting.task_name} · {candidate.policy} · {setting.convention}{way}: '
        f'{reached} of {len(candidate.episodes)} end at the goal'
    )


def result(candidate: Candidate) -> str:
    """Returns the figures of a policy's episodes, of which there is one or more, in two lines."""
    figures = summary.summarize(candidate.episodes)
    low, high = (100 * each for each in figures['success_interval'])
    count = len(candidate.episodes)
    policy = candidate.policy
    if len(policy) > _LONGEST_POLICY:
        policy = f'...{policy[3 - _LONGEST_POLICY :]}'
    return (
        f'Success {100 * figures["success_rate"]:.1f} % ({low:.1f} to {high:.1f} %) of {count} '
        f'{"episode" if count == 1 else "episodes"}: {policy}\n'
        f'  distance {100 * figures["final_distance_m"]["mean"]:.1f} cm, '
        f'return {figures["return"]["mean"]:.4g}, '
        f'{figures["control_steps_per_second"]:.0f} control steps/s in the environment'
    )
