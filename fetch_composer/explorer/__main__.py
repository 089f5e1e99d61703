"""Runs a policy on a Fetch task without a display and writes down what happened.

Per run one page, report.html, and beside it films, a contact sheet, a plot of distance and return
over time, the trajectories and a summary. A run that was stopped or killed is continued by the same
command.
"""

import os
import signal
import sys
import typing
from collections.abc import Sequence

from absl import flags as absl_flags
from absl import logging

from fetch_composer import terminal
from fetch_composer.explorer import gl

if typing.TYPE_CHECKING:
    from fetch_composer.explorer import run as run_lib
    from fetch_composer.explorer.results import writing

_SIGNALLED = 128  # Plus the signal's number: what a shell reports of a stopped process.
_COLUMNS = 80


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs what the command line asks for, with the OpenGL backend that `gl.choose` has found.

    Args:
        arguments: What follows the program's name; by default of this process.

    Returns:
        The exit status.
    """
    logging.set_verbosity(logging.WARNING)
    terminal.print_whatever_there_is()
    try:
        return _explore(sys.argv[1:] if arguments is None else arguments, gl.chosen())
    except KeyboardInterrupt:
        print('\nInterrupted: no file was left half-written.', file=sys.stderr)
        return _SIGNALLED + signal.SIGINT


def _explore(arguments: Sequence[str], gl_backend: str | None) -> int:
    try:
        from fetch_composer import user_modules
        from fetch_composer.explorer import flags
    except ModuleNotFoundError as error:
        return _fail_for_lack_of(error)

    parser = flags.parser()
    try:
        _, *others = parser([_program(), *arguments])
    except absl_flags.Error as error:
        return _fail(str(error))
    if parser['help'].value:
        _, _, texts = parser.get_help(include_special_flags=False).partition(':\n')
        print(f'{__doc__}\nUsage: {_program()} [flags]\n\n{texts}')
        return 0
    if others:
        return _fail(f'unexpected argument {others[0]!r}; all options are flags, see --help.')

    try:
        # With all that draws the report, which help and a mistyped flag need not wait for.
        from fetch_composer.explorer import run as run_lib
    except ModuleNotFoundError as error:
        return _fail_for_lack_of(error)
    try:
        user_modules.load_all(parser['import'].value or ())  # They may bring the task.
        options = flags.make_options(flags.option_values(parser))
    except (ImportError, ValueError, RuntimeError, OSError) as error:
        return _fail(str(error))
    try:
        run = run_lib.Run(options, gl_backend, fresh=bool(parser['fresh'].value))
    except (ImportError, ValueError, RuntimeError) as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(f'Cannot write into --output_dir {options.folder}: {error.strerror}.')
    try:
        written = run.run()
    except OSError as error:
        return _fail(f'Writing into {options.folder} failed: {error}')
    except (ValueError, RuntimeError) as error:
        return _fail(str(error))
    finally:
        run.close()
    _report(run, written)
    return _SIGNALLED + run.stopped_by if run.stopped_by else 0


def _report(run: 'run_lib.Run', written: Sequence['writing.Written']) -> None:
    # The table of a standard evaluation is all that it writes to standard output.
    notes = sys.stderr if run.options.standard else sys.stdout
    if run.continued:
        print(f'Continued: {run.continued} episodes were there already.', file=notes)
    if run.stopped_by:
        print(f'Stopped by {run.stopped_by.name} after {run.finished} episodes.', file=notes)
    if not run.finished:
        print('No episode was finished; nothing was written.', file=notes)
        return
    if run.stopped_by:
        print('The same command continues.', file=notes)
    print('\n'.join(run.results), file=notes if run.stopped_by else sys.stdout)
    for remark in run.remarks:
        print(remark, file=sys.stderr)
    print(f'Open, in {run.options.folder}:', file=notes)
    print('\n'.join(_listed(written)), file=notes)


def _listed(written: Sequence['writing.Written']) -> list[str]:
    """Returns lines that list files: beside each what is in it, or below where that is too wide."""
    names = [
        each.names[0] if len(each.names) == 1 else f'{each.names[0]} ... {each.names[-1]}'
        for each in written
    ]
    contents = [each.content for each in written]
    column = max(map(len, names)) + 2
    if 2 + column + max(map(len, contents)) <= _COLUMNS:
        return [
            f'  {name:<{column}}{content}' for name, content in zip(names, contents, strict=True)
        ]
    return [f'  {name}\n      {content}' for name, content in zip(names, contents, strict=True)]


def _program() -> str:
    name = os.path.basename(sys.argv[0])
    return 'python -m fetch_composer.explorer' if name == '__main__.py' else name


def _fail_for_lack_of(error: ModuleNotFoundError) -> int:
    return _fail(f"{error.name} is not installed: pip install 'fetch_composer[explore]'")


def _fail(message: str) -> int:
    print(f'{_program()}: error: {message}', file=sys.stderr)
    return 1


if __name__ == '__main__':
    if gl.choose():
        gl.start_again()
    sys.exit(main())
