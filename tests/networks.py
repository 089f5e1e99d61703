"""ONNX files to test with."""

import numpy as np
import pytest


def save(path, inputs, outputs=(('action', ['batch', 4]),), double=False):
    """Writes a network whose action is a linear function of its inputs, in their order."""
    onnx = pytest.importorskip('onnx')
    pytest.importorskip('onnxruntime')
    helper = onnx.helper
    kind = onnx.TensorProto.DOUBLE if double else onnx.TensorProto.FLOAT
    width = sum(shape[-1] for _, shape in inputs)
    weights = np.linspace(-1, 1, 4 * width).reshape(width, 4)
    weights = weights.astype(np.float64 if double else np.float32)
    nodes = [
        helper.make_node('Concat', [name for name, _ in inputs], ['joined'], axis=-1),
        *(helper.make_node('MatMul', ['joined', 'weights'], [name]) for name, _ in outputs),
    ]
    graph = helper.make_graph(
        nodes,
        'policy',
        [helper.make_tensor_value_info(name, kind, shape) for name, shape in inputs],
        [helper.make_tensor_value_info(name, kind, shape) for name, shape in outputs],
        [onnx.numpy_helper.from_array(weights, 'weights')],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 17)], ir_version=8)
    onnx.save(model, path)
    return weights


def keep_weights_apart(path):
    """Moves the weights of a network into a file beside it, which is returned."""
    onnx = pytest.importorskip('onnx')
    onnx.save(
        onnx.load(str(path)),
        str(path),
        save_as_external_data=True,
        location='weights.bin',
        size_threshold=0,
    )
    return path.parent / 'weights.bin'


def save_of_width_3(path):
    onnx = pytest.importorskip('onnx')
    pytest.importorskip('onnxruntime')
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    weights = onnx.numpy_helper.from_array(np.ones((25, 3), np.float32), 'weights')
    graph = helper.make_graph(
        [helper.make_node('MatMul', ['observation', 'weights'], ['out'])],
        'policy',
        [helper.make_tensor_value_info('observation', kind, [1, 25])],
        [helper.make_tensor_value_info('out', kind, [1, 3])],
        [weights],
    )
    opset = [helper.make_opsetid('', 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), path)


def save_perceptron(path, width, hidden=128, rows='n', mixing=False):
    """Writes a network of two hidden layers, whose rows depend on each other if `mixing`."""
    onnx = pytest.importorskip('onnx')
    pytest.importorskip('onnxruntime')
    helper, kind, generator = onnx.helper, onnx.TensorProto.FLOAT, np.random.default_rng(0)
    sizes = (width, hidden, hidden, 4)
    nodes, arrays, name = [], [], 'input'
    for layer, (size, following) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
        weights = generator.normal(size=(size, following)) / np.sqrt(size)
        arrays += [
            onnx.numpy_helper.from_array(weights.astype(np.float32), f'w{layer}'),
            onnx.numpy_helper.from_array(np.full(following, 0.01, np.float32), f'b{layer}'),
        ]
        last = layer == len(sizes) - 2
        nodes += [
            helper.make_node('Gemm', [name, f'w{layer}', f'b{layer}'], [f'sum{layer}']),
            helper.make_node(
                'Tanh' if last else 'Relu', [f'sum{layer}'], ['own' if last else f'out{layer}']
            ),
        ]
        name = f'out{layer}'
    if mixing:
        nodes.append(helper.make_node('ReduceMean', ['own'], ['mean'], axes=[0], keepdims=1))
        nodes.append(helper.make_node('Sub', ['own', 'mean'], ['action']))
    else:
        nodes.append(helper.make_node('Identity', ['own'], ['action']))
    graph = helper.make_graph(
        nodes,
        'policy',
        [helper.make_tensor_value_info('input', kind, [rows, width])],
        [helper.make_tensor_value_info('action', kind, [rows, 4])],
        arrays,
    )
    opset = [helper.make_opsetid('', 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), path)
