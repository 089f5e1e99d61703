"""How the cost of a control step grows with the number of environments, as a picture."""

import pathlib
from typing import Any

import matplotlib

matplotlib.use('Agg')

from matplotlib import pyplot as plt  # noqa: E402


def save(results: dict[str, Any], path: pathlib.Path) -> None:
    """Writes the picture: medians and quartiles.

    Args:
        results: With the keys `growth` and `machine`.
        path: Of a .png file.
    """
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout='constrained')
    for label in dict.fromkeys(point['label'] for point in results['growth']):
        points = [point for point in results['growth'] if point['label'] == label]
        sizes = [point['num_envs'] for point in points]
        axes.plot(sizes, [point['cost'] * 1e6 for point in points], marker='o', label=label)
        lower, upper = zip(*(point['quartiles'] for point in points), strict=True)
        axes.fill_between(sizes, [q * 1e6 for q in lower], [q * 1e6 for q in upper], alpha=0.2)
    axes.set_xscale('log', base=2)
    axes.set_yscale('log')
    axes.xaxis.set_major_formatter('{x:.0f}')
    axes.set_xlabel('environments')
    axes.set_ylabel('µs per control step of one environment')
    axes.set_title(f'Push on {results["machine"]["processors"]} processors')
    axes.grid(which='both', alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)
