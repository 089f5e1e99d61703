"""Runs a trained policy in thousands of environments, all of it on the accelerator, with JAX.

    python examples/warp_loop.py --task push --num_envs 4096

Nothing leaves the device but the share of successes. docs/accelerator.md says what to install.
"""

import argparse
import pathlib
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import onnx

from fetch_composer import policies
from fetch_composer.warp_batch import WarpBatchEnvironment, as_jax

TRAINED = pathlib.Path(policies.__file__).parent / 'trained'


def layer_norm(x, scale, bias, epsilon):
    centred = x - x.mean(axis=-1, keepdims=True)
    return centred / jnp.sqrt((centred**2).mean(axis=-1, keepdims=True) + epsilon) * scale + bias


# What the networks of the package consist of.
OPERATIONS: dict[str, Callable] = {
    'Slice': lambda x, start, end, axis: jax.lax.slice_in_dim(x, start[0], end[0], axis=axis[0]),
    'Sub': lambda x, y: x - y,
    'Mul': lambda x, y: x * y,
    'Concat': lambda *xs, axis: jnp.concatenate(xs, axis=axis),
    'Clip': jnp.clip,
    'Gemm': lambda x, weight, bias: x @ weight + bias,
    'LayerNormalization': layer_norm,
    'Relu': jax.nn.relu,
    'Tanh': jnp.tanh,
}


def as_function(path: pathlib.Path):
    """Returns the network of a file as a compiled function of observations and goals."""
    graph = onnx.load(path).graph
    constants = {each.name: onnx.numpy_helper.to_array(each) for each in graph.initializer}

    @jax.jit
    def network(observation, desired_goal):
        values = {**constants, 'observation': observation, 'desired_goal': desired_goal}
        for node in graph.node:
            options = {each.name: onnx.helper.get_attribute_value(each) for each in node.attribute}
            inputs = [values[name] for name in node.input]
            values[node.output[0]] = OPERATIONS[node.op_type](*inputs, **options)
        return values[graph.output[0].name]

    return network


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--task', default='push', help='reach, push, slide or pick_and_place')
    parser.add_argument('--num_envs', type=int, default=4096)
    options = parser.parse_args()
    network = as_function(TRAINED / f'{options.task}_documented.onnx')
    with WarpBatchEnvironment(options.task, options.num_envs, seed=0) as batch:
        print(f'{options.num_envs} environments on {batch.device}, actions on {jax.devices()[0]}')
        for _ in range(2):  # The first compiles.
            start, observed = time.perf_counter(), as_jax(batch.reset()).observation
            for _ in range(50):
                action = network(observed['observation'], observed['desired_goal'])
                time_step = as_jax(batch.step(action))
                observed = time_step.observation
            batch.check()
            rate = 50 * options.num_envs / (time.perf_counter() - start)
            print(f'success {float((time_step.reward == 0).mean()):.3f}, {rate:,.0f} steps/s')


if __name__ == '__main__':
    main()
