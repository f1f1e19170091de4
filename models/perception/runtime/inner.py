"""Inner tensors of a network in TensorFlow Lite's format as outputs of its own: what its layers know of a picture is
more than what its last ones say."""

from collections.abc import Mapping

import flatbuffers
from ai_edge_litert import schema_py_generated as schema

_IDENTIFIER = b"TFL3"


def showing(model: bytes, tensors: Mapping[str, int]) -> bytes:
    """The network with further outputs: some of its tensors by number, under these names."""
    if not tensors:
        return model
    network = schema.ModelT.InitFromObj(schema.Model.GetRootAsModel(model, 0))
    (graph,) = network.subgraphs
    for name, number in tensors.items():
        graph.tensors[number].name = name.encode()
    graph.outputs = [*map(int, graph.outputs), *tensors.values()]
    builder = flatbuffers.Builder(len(model))
    builder.Finish(network.Pack(builder), _IDENTIFIER)
    return bytes(builder.Output())
