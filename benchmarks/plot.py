"""How the cost of a control step grows with the number of environments, as a picture."""

import pathlib
from typing import Any

import matplotlib

matplotlib.use('Agg')

from matplotlib import pyplot as plt  # noqa: E402

_OURS = 'fetch_composer'


def _costs(rows: list[dict[str, Any]]) -> dict[str, dict[int, float]]:
    """Returns {label: {num_envs: microseconds a control step of one environment}}."""
    costs: dict[str, dict[int, float]] = {}
    for row in rows:
        if row['group'] != 'batch' or 'skipped' in row or '-v4' in row['ours']:
            continue
        # Ours comes in every row; the first is as good as any.
        costs.setdefault(_OURS, {}).setdefault(row['num_envs'], row['our_cost'] * 1e6)
        costs.setdefault(row['peer'], {})[row['num_envs']] = row['peer_cost'] * 1e6
    return costs


def save(results: dict[str, Any], path: pathlib.Path) -> bool:
    """Writes the picture, if a batch was measured; returns whether one was.

    Args:
        results: What `results.measure_all` returned.
        path: Of a .png file.
    """
    costs_by_label = _costs(results['rows'])
    if not costs_by_label:
        return False
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout='constrained')
    for label, costs in costs_by_label.items():
        sizes = sorted(costs)
        axes.plot(sizes, [costs[size] for size in sizes], marker='o', label=label)
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
    return True
