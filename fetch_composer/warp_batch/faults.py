"""Notices what goes wrong on a device without waiting for it, and says what it was."""

from collections.abc import Mapping, Sequence

import warp as wp
from dm_control.rl import control

from fetch_composer.tasks import checks


class Watch:
    """Watches bits that are not 0 once something has gone wrong."""

    def __init__(self, bits: wp.array) -> None:
        """Initializes the watch.

        Args:
            bits: (1,) int32 on the device.
        """
        self._bits = bits
        is_cuda = bits.device.is_cuda
        self._copy = wp.zeros(1, dtype=int, device='cpu', pinned=is_cuda)
        self._arrived = wp.Event(bits.device) if is_cuda else None

    def look(self) -> None:
        """Has the bits copied once the device has got so far."""
        wp.copy(self._copy, self._bits)
        if self._arrived is not None:
            wp.get_stream(self._bits.device).record_event(self._arrived)

    def has_seen(self) -> bool:
        """Returns whether the latest copy has arrived and is not 0."""
        has_arrived = self._arrived is None or self._arrived.is_complete
        return has_arrived and bool(self._copy.numpy()[0])

    def found(self) -> bool:
        """Waits for the device, and returns whether its bits are not 0."""
        return bool(self._bits.numpy()[0])


def error(rows: Mapping[str, Sequence[int]], capacities: Mapping[str, int]) -> Exception:
    """Returns an error that says all that has gone wrong, of the type of the worst.

    Args:
        rows: What `Simulation.take_faults` returned.
        capacities: What there was room for, by the name of the argument.
    """
    messages = [
        f'{name} ({value}) was too small in environments {checks.shown(rows[name])}, whose physics '
        f'is wrong since: make the batch with {name}={2 * value}.'
        for name, value in capacities.items()
        if name in rows
    ]
    kind: type[Exception] = RuntimeError
    if 'diverged' in rows:
        kind = kind if messages else control.PhysicsError
        messages.append(f'Physics diverged in environments {checks.shown(rows["diverged"])}.')
    if 'actions' in rows:
        kind = kind if messages else ValueError
        messages.append(
            f'Actions must be finite; rows {checks.shown(rows["actions"])} were not, and were '
            'taken as zeros.'
        )
    return kind(' '.join(messages))
