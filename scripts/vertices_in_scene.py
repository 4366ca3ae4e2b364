"""Where Blender draws a mesh, for the scripts that compare it with other programs'."""

import bpy
import numpy


def vertices_in_scene(body):
    """Where Blender draws a body's vertices, Y up."""
    posed = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = posed.to_mesh()
    places = numpy.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", places)
    matrix = numpy.array(posed.matrix_world)
    x, y, z = (places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]).T
    return numpy.stack([x, z, -y], axis=1)
