"""Lets links of the pages lead somewhere in the site too, where they lead to files beside docs.

On GitHub `[planning.py](../examples/planning.py)` shows the file, and a folder its files. In the
site either is a page of its own, which is written into docs/generated.
"""

import pathlib
import re
import shutil

_ROOT = pathlib.Path(__file__).parents[2]
_DOCS = _ROOT / 'docs'
GENERATED = _DOCS / 'generated'
_FILES = GENERATED / 'files'

_LINK = re.compile(r'\]\(([^)#\s]*)(#[^)\s]*)?\)')
_LANGUAGES = {
    '.yml': 'yaml',
    '.py': 'python',
    '.json': 'json',
    '.csv': 'text',
    '.txt': 'text',
    '.md': 'markdown',
}
_PICTURES = ('.png', '.gif')
_ORPHAN = '---\norphan: true\n---\n\n'


def rewritten(text: str, page: pathlib.Path) -> str:
    """Returns the text of a page with its links to files of the repository as the site has them.

    Args:
        text: The page, in Markdown.
        page: Where it is; links are relative to its folder.
    """

    def link(match: re.Match) -> str:
        path = _linked(page, match[1])
        return match[0] if path is None else f']({_place(path)}{match[2] or ""})'

    return _LINK.sub(link, text)


def linked(pages: list[pathlib.Path]) -> list[pathlib.Path]:
    """Returns the files and folders that need pages of their own: what is linked, and what then is.

    Args:
        pages: Pages in Markdown.
    """
    found: list[pathlib.Path] = []
    waiting = list(pages)
    while waiting:
        page = waiting.pop(0)
        if page.is_dir():
            links = [each for each in sorted(page.iterdir()) if _is_shown(each)]
        elif page.suffix == '.md':
            targets = [match[1] for match in _LINK.finditer(page.read_text(encoding='utf-8'))]
            links = [each for each in (_linked(page, target) for target in targets) if each]
        else:
            links = []
        new = [each for each in links if not _is_in_site(each) and each not in found]
        found += new
        waiting += new
    return found


def write() -> None:
    """Writes the pages of what is linked, and the README for the front page to include."""
    shutil.rmtree(_FILES, ignore_errors=True)
    pages = [each for each in _DOCS.rglob('*.md') if GENERATED not in each.parents]
    readme = _ROOT / 'README.md'
    for path in linked([*pages, readme]):
        page = _DOCS / _place(path)[1:]
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(_ORPHAN + _page(path), encoding='utf-8')
    front = rewritten(readme.read_text(encoding='utf-8'), readme)
    (_FILES / 'readme.inc').write_text(front, encoding='utf-8')


def _page(path: pathlib.Path) -> str:
    name = path.relative_to(_ROOT)
    if path.suffix == '.md':
        return rewritten(path.read_text(encoding='utf-8'), path)
    if path.is_dir():
        files = [each for each in sorted(path.iterdir()) if _is_shown(each)]
        lines = [f'* [`{each.name}`]({_place(each)})' for each in files]
        return f'# {name}\n\n' + '\n'.join(lines) + '\n'
    language = _LANGUAGES[path.suffix]
    return f'# {name}\n\n```{{literalinclude}} /../{name}\n:language: {language}\n```\n'


def _linked(page: pathlib.Path, target: str) -> pathlib.Path | None:
    """Returns the file or folder of the repository that a link leads to; None if to neither."""
    path = (page.parent / target).resolve() if target else page
    return path if path.exists() and _ROOT in path.parents else None


def _is_shown(path: pathlib.Path) -> bool:
    return path.suffix in _LANGUAGES or (path.is_dir() and not path.name.startswith(('_', '.')))


def _is_in_site(path: pathlib.Path) -> bool:
    """Returns whether it is a page or picture of the site without a page being generated."""
    return _DOCS in path.parents and path.suffix in ('.md', *_PICTURES)


def _place(path: pathlib.Path) -> str:
    """Returns the page, as Sphinx names it from docs, that a file or folder has in the site."""
    if _is_in_site(path):
        return f'/{path.relative_to(_DOCS)}'
    name = str(path.relative_to(_ROOT))
    return f'/generated/files/{name if path.suffix == ".md" else name + ".md"}'
