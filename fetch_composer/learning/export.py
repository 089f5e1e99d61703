"""Writes a policy as an ONNX file, which `fetch_composer.policies.load` reads."""

import pathlib

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from fetch_composer.explorer import files
from fetch_composer.learning import networks

_OPSET = 17  # The first with LayerNormalization.
_IR_VERSION = 9


class _Graph:
    """Nodes and constants, put one after the other."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def add(self, operation: str, inputs: list, output: str = '', **attributes) -> str:
        """Adds a node and returns the name of its output; arrays among inputs are constants."""
        output = output or f'x{len(self.nodes)}'
        names = [each if isinstance(each, str) else self._constant(each) for each in inputs]
        self.nodes.append(helper.make_node(operation, names, [output], **attributes))
        return output

    def _constant(self, value) -> str:
        name = f'c{len(self.constants)}'
        array = np.asarray(value)
        if array.dtype.kind == 'f':
            array = array.astype(np.float32)
        self.constants.append(numpy_helper.from_array(array, name))
        return name


def save(path: pathlib.Path, policy: networks.Policy, observation_size: int) -> None:
    """Writes a policy.

    The network takes `observation` (batch, size) and `desired_goal` (batch, goal_size), and gives
    `action` (batch, 4); the number of rows is free.
    """
    mean, inverse_deviation = policy.scale
    indices = networks.achieved_goal_indices(observation_size)
    graph = _Graph()
    achieved = graph.add('Gather', ['observation', indices], axis=1)
    way = graph.add('Sub', ['desired_goal', achieved])
    features = graph.add('Concat', ['observation', 'desired_goal', way], axis=1)
    x = graph.add('Mul', [graph.add('Sub', [features, mean]), inverse_deviation])
    limit = networks.FEATURE_LIMIT
    x = graph.add('Clip', [x, np.array(-limit), np.array(limit)])
    for layer in policy.actor[:-1]:
        x = graph.add('Gemm', [x, layer['weight'], layer['bias']])
        x = graph.add(
            'LayerNormalization',
            [x, layer['norm_scale'], layer['norm_bias']],
            epsilon=networks.LAYER_NORM_EPSILON,
        )
        x = graph.add('Relu', [x])
    last = policy.actor[-1]
    graph.add('Tanh', [graph.add('Gemm', [x, last['weight'], last['bias']])], output='action')

    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            'policy',
            [_rows('observation', observation_size), _rows('desired_goal', len(indices))],
            [_rows('action', networks.ACTION_SIZE)],
            graph.constants,
        ),
        opset_imports=[helper.make_opsetid('', _OPSET)],
        ir_version=_IR_VERSION,
    )
    onnx.checker.check_model(model)
    with files.whole_file(path) as partial:
        onnx.save(model, partial)


def _rows(name: str, size: int) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, ['batch', size])
