"""Learns a task from nothing, and writes its curve and its policy.

python -m fetch_composer.learning --task push
"""

import argparse
import os
import pathlib
import subprocess
import sys
import typing

from fetch_composer import terminal

if typing.TYPE_CHECKING:
    from fetch_composer.learning import train

# The networks are so small that more threads would only wait for one another.
_ONE_THREAD = '--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1'
_REPORTED_EPISODES = 8


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m fetch_composer.learning',
        description=__doc__.splitlines()[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument('--task', default='push', help='name of the task')
    parser.add_argument(
        '--convention', default='documented', help='documented or gymnasium_robotics'
    )
    parser.add_argument('--seed', type=int, default=0, help='fixes the run')
    parser.add_argument('--minutes', type=float, help='end after so many, finished or not')
    parser.add_argument('--frugal', action='store_true', help='save control steps, not time')
    parser.add_argument(
        '--set', action='append', default=[], metavar='NAME=VALUE', help='change a setting'
    )
    parser.add_argument('--num_threads', type=int, help='of the simulation; all processors if None')
    parser.add_argument('--device', help='of Warp, such as cuda, to simulate on; needs [warp]')
    parser.add_argument(
        '--report',
        action=argparse.BooleanOptionalAction,
        default=True,
        help='let the explorer film the policy at the end',
    )
    parser.add_argument(
        '--output_dir', type=pathlib.Path, help='folder to write into; output/learn_TASK if None'
    )
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; returns its exit status."""
    terminal.print_whatever_there_is()
    flags = _parser().parse_args(arguments)
    environment = dict(os.environ)  # As the explorer needs it: it draws.
    os.environ.setdefault('XLA_FLAGS', _ONE_THREAD)
    os.environ.setdefault('MUJOCO_GL', 'disabled')  # Nothing is drawn here.
    try:
        import tqdm

        from fetch_composer.learning import settings, train
    except ModuleNotFoundError as error:
        print(f"{error}: pip install 'fetch_composer[learn]'", file=sys.stderr)
        return 1
    folder = flags.output_dir or pathlib.Path(f'output/learn_{flags.task}')
    try:
        changes = dict(settings.parse(each) for each in flags.set)
        options = train.Options(
            task=flags.task,
            convention=flags.convention,
            seed=flags.seed,
            settings=settings.for_task(flags.task, flags.frugal, changes),
            minutes=flags.minutes,
            output_dir=folder,
            num_threads=flags.num_threads,
            device=flags.device,
        )
        with tqdm.tqdm(total=options.settings.environment_steps, unit=' steps') as line:

            def show(point) -> None:
                line.set_description_str(f'success {point.success:.2f}', refresh=False)
                line.set_postfix_str(f'{point.minutes:.1f} min', refresh=False)
                line.update(point.environment_steps - line.n)

            run = train.Run(options, show)
            try:
                if run.points:
                    show(run.points[-1])
                summary = run.run()
            finally:
                run.close()
    except (ValueError, OSError, ArithmeticError, ImportError) as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('\nStopped; the same command continues from the last checkpoint.', file=sys.stderr)
        return 130
    low, high = summary['success_interval']
    print(
        f'success {summary["success_rate"]:.3f} ({low:.3f} to {high:.3f}) over '
        f'{summary["episodes"]} held-out episodes, after {summary["environment_steps"]} steps and '
        f'{summary["minutes"]:.1f} min',
        flush=True,
    )
    if (folder / 'curve.png').exists():  # A run that time has ended may have no point of it.
        print(f'open {folder / "curve.png"}', flush=True)
    return _explore(options, environment) if flags.report else 0


def _explore(options: 'train.Options', environment: dict[str, str]) -> int:
    """Lets the explorer report on the policy; returns its exit status."""
    from fetch_composer.explorer.episodes import seeds

    folder = options.output_dir
    command = [sys.executable, '-m', 'fetch_composer.explorer', f'--task={options.task}']
    command += [f'--convention={options.convention}', f'--policy={folder / "policy.onnx"}']
    command += [f'--max_episode_steps={options.settings.episode_steps}']
    command += [f'--seed={seeds.TUNING.start}', f'--episodes={_REPORTED_EPISODES}']
    command += [f'--output_dir={folder / "report"}']
    return subprocess.run(command, env=environment, check=False).returncode


if __name__ == '__main__':
    sys.exit(main())
