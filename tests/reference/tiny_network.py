"""A mask network of isnet's shape that knows nothing."""

from pathlib import Path


def write_network(path: Path, channels: int = 1) -> Path:
    """A network of isnet's shape: the red channel at half the size, and another output to be ignored."""
    import onnx
    from onnx import TensorProto, helper

    nodes = [
        helper.make_node("Slice", ["image", "starts", "ends", "axes"], ["red"]),
        helper.make_node("AveragePool", ["red"], ["mask"], kernel_shape=[2, 2], strides=[2, 2]),
        helper.make_node("Neg", ["mask"], ["other"]),
    ]
    constants = [
        helper.make_tensor(name, TensorProto.INT64, [1], [value])
        for name, value in (("starts", 0), ("ends", channels), ("axes", 1))
    ]
    shape = [1, 3, 1024, 1024]
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, shape)
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, 512, 512])
        for name in ("mask", "other")
    ]
    graph = helper.make_graph(nodes, "isnet in small", [image], outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path
