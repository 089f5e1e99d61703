"""Many environments that step together in one native call."""

from fetch_composer.batch.batch_environment import BatchEnvironment

__all__ = ('BatchEnvironment',)
