"""The flags of the command line, made from the fields of the options.

A field's name, type, default and text are those of its flag. The text is what the docstring of its
class has to say of it.
"""

import dataclasses
import inspect
import re
import shlex
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from absl import flags

from fetch_composer import tasks
from fetch_composer.explorer.options import NOT_EXPLORED, Options
from fetch_composer.explorer.results import standard
from fetch_composer.tasks import TaskOptions

# What tells of a run of many episodes, and nothing of each.
_OF_MANY_EPISODES = frozenset(
    ('episodes', 'standard', 'num_envs', 'films', 'num_films', 'ray', 'dataset', 'output_dir')
)
# What the names of the policies say that act.
_IN_NAMES = frozenset(('noise', 'mixture'))
_OF_THE_COMMAND = {
    'fresh': 'Whether to discard an unfinished run in the folder, rather than to continue it',
    'help': 'Whether to list the flags, and do nothing else',
}
_ATTRIBUTE = re.compile(r'    (\w+): (.*)')
# Whose default is the task's: its flag has none.
_OF_EACH_TASK = 'max_episode_steps'
_ABOUT_NONE = re.compile('; None .*')  # Which a flag is only where it is not given.


class _NumbersParser(flags.ArgumentParser):
    """Reads numbers with commas between them."""

    syntactic_help = 'numbers with commas between them'

    def parse(self, argument) -> tuple[float, ...]:
        try:
            return tuple(float(each) for each in argument.split(','))
        except ValueError:
            raise ValueError(
                f'must be numbers with commas between them, such as 1.3,0.75; got {argument!r}.'
            ) from None


def _define_numbers(name: str, default, text: str, flag_values: flags.FlagValues) -> None:
    flags.DEFINE(_NumbersParser(), name, default, text, flag_values)


@dataclasses.dataclass(frozen=True)
class _Flag:
    """A flag.

    Attributes:
        name: Its name.
        field: Name of the field that it fills.
        of_task: Whether the field is one of `TaskOptions`, or of `Options`.
        kind: Type of its value; None is no type of it, but may be its default.
        default: Its default.
        text: Its help.
    """

    name: str
    field: str
    of_task: bool
    kind: Any
    default: Any
    text: str

    def value(self, options: Options) -> Any:
        """Returns its value in options, fit for JSON."""
        value = getattr(options.task_options if self.of_task else options, self.field)
        if value is None or self.kind not in (Sequence[str], Sequence[float]):
            return value
        (element,) = typing.get_args(self.kind)
        return [element(each) for each in value]

    def words(self, value: Any) -> list[str]:
        """Returns the words of a command line that give it a value."""
        if self.kind is bool:
            return [f'--{self.name}' if value else f'--no{self.name}']
        if self.kind == Sequence[str]:
            return [f'--{self.name}={each}' for each in value]
        if self.kind == Sequence[float]:
            return [f'--{self.name}={",".join(map(repr, value))}']
        return [f'--{self.name}={value}']


_DEFINITIONS: dict[Any, Callable[..., Any]] = {
    str: flags.DEFINE_string,
    int: flags.DEFINE_integer,
    float: flags.DEFINE_float,
    bool: flags.DEFINE_bool,
    Sequence[str]: flags.DEFINE_multi_string,
    Sequence[float]: _define_numbers,
}


def _flags_of(options_class: type) -> Iterator[_Flag]:
    types_of, texts = typing.get_type_hints(options_class), _texts(options_class)
    of_task = options_class is TaskOptions
    for field in dataclasses.fields(options_class):
        if field.type is TaskOptions:
            yield from _flags_of(TaskOptions)
            continue
        if of_task and field.name in NOT_EXPLORED:
            continue
        yield _Flag(
            name=field.metadata.get('flag', field.name),
            field=field.name,
            of_task=of_task,
            kind=_without_none(types_of[field.name]),
            default=None if field.name == _OF_EACH_TASK else field.default,
            text=texts.get(field.name, ''),
        )


def _without_none(annotation: Any) -> Any:
    if typing.get_origin(annotation) not in (typing.Union, types.UnionType):
        return annotation
    (kind,) = (each for each in typing.get_args(annotation) if each is not types.NoneType)
    return kind


def _texts(options_class: type) -> dict[str, str]:
    """Returns what the section Attributes of a docstring says, by name."""
    # Without docstrings (`python -OO`), flags have no text.
    _, _, section = (inspect.getdoc(options_class) or '').partition('\nAttributes:\n')
    texts: dict[str, str] = {}
    name = ''
    for line in section.partition('\n\n')[0].splitlines():
        match = _ATTRIBUTE.fullmatch(line)
        if match:
            name, texts[match[1]] = match[1], match[2]
        else:
            texts[name] += f' {line.strip()}'
    return {name: _ABOUT_NONE.sub('', text).rstrip('.') for name, text in texts.items()}


_FLAGS = tuple(_flags_of(Options))


def parser() -> flags.FlagValues:
    """Returns what parses a command line: a flag for every option, and the command's own."""
    found = flags.FlagValues()
    for each in _FLAGS:
        default = list(each.default) if each.kind == Sequence[str] else each.default
        _DEFINITIONS[each.kind](each.name, default, each.text, flag_values=found)
    for name, text in _OF_THE_COMMAND.items():
        flags.DEFINE_bool(name, False, text, flag_values=found)
    return found


def option_values(parsed: flags.FlagValues) -> dict[str, Any]:
    """Returns the values of the flags that are options, by name."""
    has_defaults = not parsed['standard'].value
    flags_given = (parsed[each.name] for each in _FLAGS)
    return {each.name: each.value for each in flags_given if has_defaults or each.present}


def make_options(values: Mapping[str, Any]) -> Options:
    """Returns options.

    Args:
        values: Values of flags by name; others have their defaults.

    Raises:
        ValueError: if a value is not valid, or there is no such flag; the message says what is.
    """
    unknown = sorted(set(values) - {each.name for each in _FLAGS})
    if unknown:
        valid = ', '.join(each.name for each in _FLAGS)
        raise ValueError(f'Unknown option {", ".join(map(repr, unknown))}; valid are {valid}.')
    if values.get('standard'):
        fixed = standard.fixed(values.get('task', Options.task))
        values = {'films': 'none', **fixed, **values}
    fields: dict[bool, dict[str, Any]] = {False: {}, True: {}}
    for each in _FLAGS:
        if each.name in values and not (each.name == _OF_EACH_TASK and values[each.name] is None):
            value = values[each.name]
            fields[each.of_task][each.field] = tuple(value) if isinstance(value, list) else value
    task_options = dataclasses.replace(
        _default_options(fields[False].get('task', Options.task)), **fields[True]
    )
    return Options(task_options=task_options, **fields[False])


def _default_options(task: str) -> TaskOptions:
    return tasks.default_options(task) if task in tasks.ALL else TaskOptions()


def flag_values(options: Options) -> dict[str, Any]:
    """Returns the values of all flags by name, fit for JSON."""
    return {each.name: each.value(options) for each in _FLAGS}


def replay_command(options: Options, policies: Sequence[str], seed: int) -> str:
    """Returns the command that runs one episode of a run again, filmed, in a folder of its own.

    Args:
        options: Options of the run.
        policies: Those of its policies that act, by their whole names.
        seed: Seed of the episode.
    """
    values = {
        'task': options.task,
        'policy': list(policies),
        'seed': seed,
        'episodes': 1,
        'output_dir': options.folder / f'seed_{seed}',
    }
    words = []
    defaults = Options(task_options=_default_options(options.task))
    for each in _FLAGS:
        default = each.value(defaults)
        if each.name in values:
            words += each.words(values[each.name])
        elif each.name in _OF_MANY_EPISODES | _IN_NAMES:
            continue
        elif each.value(options) != default:
            words += each.words(each.value(options))
    return shlex.join(['python', '-m', 'fetch_composer.explorer', *words])
