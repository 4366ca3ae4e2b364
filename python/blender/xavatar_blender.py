"""Blender's add-on of xavatar: an avatar's armature, and its field's own surface in every frame.

Install it from Edit > Preferences > Add-ons > Install from Disk; the panel is in the 3D view's sidebar, "xavatar". File > Import > xavatar
avatar makes an armature and a mesh. Whenever the armature's pose changes with the frame, and when "Extract" is pressed, the mesh is made
anew from the avatar's fields: without hidden surfaces, with colours. "Import motion" puts any motion of docs/motion.md on the armature.

The module ``xavatar`` is used if Blender's Python has it (docs/python.md), else the program ``xavatar``: that on the PATH, or the one that
the add-on's preferences name.

The armature object turns the library's axes (Y up, facing +Z) to Blender's (Z up, facing -Y): in its own space everything is as in the
library. A bone's rotation R relative to its parent, in those axes, and its basis matrix M in the bone's are R = B M B^-1, with B the bone's
axes at rest. Metres, radians.
"""

import json
import math
import os
import pathlib
import shutil
import struct
import subprocess
import tempfile
import urllib.request

import bpy
import numpy
from bpy_extras.io_utils import ImportHelper
from mathutils import Quaternion, Vector

bl_info = {
    "name": "xavatar",
    "description": "Animatable neural avatars: their armature, and their own surface in every frame",
    "author": "The xavatar developers",
    "version": (0, 1, 0),
    "blender": (4, 1, 0),
    "location": "File > Import, and the 3D view's sidebar",
    "category": "Import-Export",
}

#: From Y up, facing +Z, to Z up, facing -Y.
UPRIGHT = (math.pi / 2, 0.0, 0.0)
#: The length of a bone that no other hangs on, as a share of its parent's.
TIP = 0.6
#: Coefficients of expression that an armature has; an avatar may take fewer.
EXPRESSIONS = 10
#: The shortest bone, metres: Blender drops those of no length.
SHORTEST = 0.01


class Failure(Exception):
    """What the user is told."""


# --- Where surfaces come from -------------------------------------------------------------------------------------------------------


class Surface:
    """A mesh: vertices (V, 3), faces (F, 3), normals (V, 3), colours (V, 3) uint8."""

    def __init__(self, vertices, faces, normals, colours):
        self.vertices, self.faces, self.normals, self.colours = vertices, faces, normals, colours


class ModuleSource:
    """An avatar by the module ``xavatar``."""

    def __init__(self, module, avatar, body):
        self.module = module
        self.avatar = module.load(avatar, body=body or None)
        self.joints, self.rest = self.avatar.joints, numpy.asarray(self.avatar.rest_joints)
        self.parents = [int(parent) for parent in self.avatar.parents]

    def surface(self, rotations, translation, expression, resolution):
        pose = self.module.Pose(rotations, translation, expression[: self.avatar.expression_coefficients])
        mesh = self.avatar.pose(pose, resolution=resolution)
        return Surface(mesh.vertices, mesh.faces, mesh.normals, mesh.colours)

    def motion(self, path):
        """Rotations (T, J, 3), translations (T, 3), expressions (T, E), frames a second."""
        motion = self.module.read_motion(path, self.avatar)
        expressions = [pose.expression for pose in motion]
        return motion.rotations, motion.translations, expressions, motion.frames_per_second


class ProgramSource:
    """An avatar by the program ``xavatar``: a server of its own, that is asked for meshes as the page of ``xavatar view`` asks."""

    def __init__(self, program, avatar, body):
        self.program, self.path, self.body = program, avatar, ["--body", body] if body else []
        subject = json.loads(self._run("info", avatar, "--json", "-"))["subject"]
        skeleton, self.expressions = subject["skeleton"], subject["expressions"]
        self.joints = skeleton["joints"]
        self.parents = [-1 if parent is None else parent for parent in skeleton["parents"]]
        self.rest = numpy.array(self._rest_joints(), dtype=float)
        command = [program, "view", avatar, *self.body, "--port", "0", "--quiet"]
        self.server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.address = self.server.stdout.readline().strip()
        if not self.address:
            raise Failure(f"{' '.join(command)} serves nothing; run it in a terminal to see why")

    def __del__(self):
        if hasattr(self, "server"):
            self.server.kill()
            self.server.wait()

    def surface(self, rotations, translation, expression, resolution):
        turns = {joint: turn.tolist() for joint, turn in zip(self.joints, rotations)}
        translation, expression = ([float(value) for value in row] for row in (translation, expression[: self.expressions]))
        pose = {"rotations": turns, "translation": translation, "expression": expression}
        request = urllib.request.Request(
            self.address + "mesh",
            json.dumps({"pose": pose, "resolution": resolution}).encode(),
            {"Content-Type": "application/json"},
        )
        with urllib.request.urlopen(request) as answer:
            return surface_of_message(answer.read())

    def motion(self, path):
        document, binary = self._exported("--motion", path)
        return motion_of_glb(document, binary, self.joints, self.rest[0])

    def _rest_joints(self):
        """Where the joints are at rest: what a GLB's nodes add up to, whose turns are the pose's."""
        document, _ = self._exported()
        places = {node["name"]: node.get("translation", [0, 0, 0]) for node in document["nodes"] if "name" in node}
        rest = []
        for joint, parent in zip(self.joints, self.parents):
            above = rest[parent] if parent >= 0 else [0, 0, 0]
            rest.append([a + b for a, b in zip(above, places[joint])])
        return rest

    def _exported(self, *options):
        """The document and the binary part of a small GLB."""
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "avatar.glb")
            self._run("export", self.path, *self.body, *options, "--resolution", "32", "--texture", "0", "--out", path)
            content = pathlib.Path(path).read_bytes()
        length = struct.unpack_from("<I", content, 12)[0]
        return json.loads(content[20 : 20 + length]), content[28 + length :]

    def _run(self, *arguments):
        done = subprocess.run([self.program, *arguments], capture_output=True, text=True)
        if done.returncode != 0:
            raise Failure(done.stderr.strip() or f"{self.program} {arguments[0]} failed")
        return done.stdout


def surface_of_message(message):
    """The mesh in an answer of ``POST /mesh`` (docs/report.md)."""
    count, faces = struct.unpack_from("<II", message, 0)
    points = numpy.frombuffer(message, "<f4", 6 * count, 16).reshape(2, count, 3)
    colours = numpy.frombuffer(message, numpy.uint8, 3 * count, 16 + 24 * count).reshape(count, 3)
    first = (16 + 27 * count + 3) // 4 * 4
    return Surface(points[0], numpy.frombuffer(message, "<u4", 3 * faces, first).reshape(faces, 3), points[1], colours)


def motion_of_glb(document, binary, joints, root):
    """The motion in a GLB's clip, whose joints' local rotations are those of the pose; without expressions, which are morphs there."""

    def array(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return numpy.frombuffer(binary, "<f4", accessor["count"] * width, start).reshape(-1, width)

    animation = document["animations"][0]
    tracks = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        name = document["nodes"][channel["target"].get("node", 0)].get("name")
        tracks[name, channel["target"]["path"]] = array(sampler["input"])[:, 0], array(sampler["output"])
    times = max((times for times, _ in tracks.values()), key=len)
    rotations = numpy.zeros((len(times), len(joints), 3))
    for place, joint in enumerate(joints):
        if (joint, "rotation") in tracks:
            own, quaternions = tracks[joint, "rotation"]
            quaternions = quaternions[numpy.searchsorted(own, times).clip(0, len(own) - 1)]
            rotations[:, place] = [Quaternion((w, x, y, z)).to_exponential_map() for x, y, z, w in quaternions]
    translations = numpy.zeros((len(times), 3))
    if (joints[0], "translation") in tracks:
        own, places = tracks[joints[0], "translation"]
        translations = places[numpy.searchsorted(own, times).clip(0, len(own) - 1)] - root
    rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 30.0
    return rotations, translations, [()] * len(times), float(rate)


SOURCES = {}


def source_of(armature):
    """Where an armature's surfaces come from: loaded once."""
    settings = armature.xavatar
    key = settings.avatar, settings.body
    if key not in SOURCES:
        SOURCES[key] = opened(bpy.path.abspath(settings.avatar), bpy.path.abspath(settings.body) if settings.body else "")
    return SOURCES[key]


def opened(avatar, body):
    """An avatar by the module, if there is one, else by the program."""
    preferences = bpy.context.preferences.addons.get(__name__)
    named = preferences.preferences.program if preferences else os.environ.get("XAVATAR_PROGRAM", "")
    if not named:
        try:
            import xavatar
        except ImportError:
            pass
        else:
            return ModuleSource(xavatar, avatar, body)
    program = shutil.which(named or "xavatar")
    if program is None:
        raise Failure(f"neither the module xavatar nor the program {named or 'xavatar'} is here; install one (docs/python.md)")
    return ProgramSource(program, avatar, body)


# --- Armature and pose --------------------------------------------------------------------------------------------------------------


def add_armature(name, source):
    """An armature whose bones turn about the avatar's joints."""
    data = bpy.data.armatures.new(name)
    armature = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(armature)
    armature.rotation_euler = UPRIGHT
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bones = []
    for place, joint in enumerate(source.joints):
        bone = data.edit_bones.new(joint)
        bone.head, bone.tail = (Vector(end) for end in ends(source, place))
        parent = source.parents[place]
        if parent >= 0:
            bone.parent = bones[parent]
        bones.append(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    data.display_type = "STICK"
    for bone in armature.pose.bones:
        bone.rotation_mode = "QUATERNION"
    return armature


def ends(source, place):
    """Where the bone of a joint begins and ends: at the middle of those that hang on it, or on beyond its own parent's."""
    head = source.rest[place]
    children = [source.rest[child] for child, parent in enumerate(source.parents) if parent == place]
    parent = source.parents[place]
    along = numpy.mean(children, axis=0) - head if children else TIP * (head - source.rest[parent] if parent >= 0 else [0, 1, 0])
    if numpy.linalg.norm(along) < SHORTEST:
        along = numpy.array([0.0, SHORTEST, 0.0])
    return head, head + along


def pose_of(armature, source):
    """Rotations (J, 3) and translation (3) of the armature's pose as it is seen, constraints included."""
    rotations = numpy.zeros((len(source.joints), 3))
    turns = []
    for place, joint in enumerate(source.joints):
        bone = armature.pose.bones[joint]
        turn = bone.matrix.to_3x3().normalized() @ bone.bone.matrix_local.to_3x3().inverted()
        parent = source.parents[place]
        own = turns[parent].inverted() @ turn if parent >= 0 else turn
        rotations[place] = own.to_quaternion().to_exponential_map()
        turns.append(turn)
    root = armature.pose.bones[source.joints[0]]
    return rotations, numpy.array(root.matrix.translation) - source.rest[0]


def set_pose(armature, source, rotations, translation, expression=()):
    """Turns the bones as a pose has it, and sets the face."""
    for joint, turn in zip(source.joints, rotations):
        bone = armature.pose.bones[joint]
        axes = bone.bone.matrix_local.to_3x3()
        # The turn's axis as the bone sees it.
        bone.rotation_quaternion = Quaternion(axes.inverted() @ Vector(turn))
    root = armature.pose.bones[source.joints[0]]
    root.location = root.bone.matrix_local.to_3x3().inverted() @ Vector(translation)
    values = numpy.zeros(EXPRESSIONS)
    values[: len(expression)] = expression[:EXPRESSIONS]
    armature.xavatar.expression = values.tolist()


def key_pose(armature, source, frame):
    """Keys every joint's rotation, the root's place and the expression."""
    for joint in source.joints:
        armature.pose.bones[joint].keyframe_insert("rotation_quaternion", frame=frame)
    armature.pose.bones[source.joints[0]].keyframe_insert("location", frame=frame)
    armature.keyframe_insert("xavatar.expression", frame=frame)


# --- The mesh -----------------------------------------------------------------------------------------------------------------------


def fill(mesh, surface):
    """Replaces what a mesh holds by a surface."""
    count, faces = len(surface.vertices), len(surface.faces)
    mesh.clear_geometry()
    mesh.vertices.add(count)
    mesh.vertices.foreach_set("co", numpy.ascontiguousarray(surface.vertices, numpy.float32).ravel())
    mesh.loops.add(3 * faces)
    mesh.loops.foreach_set("vertex_index", numpy.ascontiguousarray(surface.faces, numpy.int32).ravel())
    mesh.polygons.add(faces)
    mesh.polygons.foreach_set("loop_start", numpy.arange(0, 3 * faces, 3, dtype=numpy.int32))
    colours = mesh.color_attributes.new("Colour", "BYTE_COLOR", "POINT")
    rows = numpy.ones((count, 4), numpy.float32)
    rows[:, :3] = surface.colours / numpy.float32(255)
    colours.data.foreach_set("color_srgb", rows.ravel())
    mesh.update(calc_edges=True)
    mesh.normals_split_custom_set_from_vertices(surface.normals.tolist())


def coloured_material():
    """A rough surface in the mesh's own colours."""
    material = bpy.data.materials.new("xavatar")
    if not material.use_nodes:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    surface = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    surface.inputs["Roughness"].default_value = 1.0
    surface.inputs["Specular IOR Level"].default_value = 0.0
    colour = nodes.new("ShaderNodeVertexColor")
    colour.layer_name = "Colour"
    links.new(colour.outputs["Color"], surface.inputs["Base Color"])
    return material


def extract(armature):
    """Makes the armature's mesh anew from the avatar's fields, unless it is that of this pose already."""
    settings, source = armature.xavatar, source_of(armature)
    # What drivers and constraints make of the pose is only there once it is evaluated.
    evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    rotations, translation = pose_of(evaluated, source)
    expression = list(settings.expression)
    seen = json.dumps([settings.resolution, rotations.round(6).tolist(), translation.round(6).tolist(), expression])
    if settings.mesh is None or settings.mesh.data.get("xavatar_pose") == seen:
        return
    fill(settings.mesh.data, source.surface(rotations, translation, expression, settings.resolution))
    settings.mesh.data["xavatar_pose"] = seen


def add_avatar(avatar, body="", resolution=128):
    """An avatar's armature with its mesh, at rest."""
    name = pathlib.Path(avatar).stem
    source = SOURCES.setdefault((avatar, body), None) or opened(avatar, body)
    SOURCES[avatar, body] = source
    armature = add_armature(name, source)
    mesh = bpy.data.objects.new(f"{name} surface", bpy.data.meshes.new(name))
    mesh.data.materials.append(coloured_material())
    # In the armature's space: moving the object moves the surface.
    mesh.parent = armature
    bpy.context.collection.objects.link(mesh)
    settings = armature.xavatar
    settings.avatar, settings.body, settings.resolution, settings.mesh = avatar, body, resolution, mesh
    extract(armature)
    return armature


def add_motion(armature, path):
    """Keys a motion on an armature, from the scene's current frame on; sets the scene's rate and end. Returns its frames."""
    source, scene = source_of(armature), bpy.context.scene
    rotations, translations, expressions, rate = source.motion(path)
    scene.render.fps, scene.render.fps_base = round(rate), round(rate) / rate
    first = scene.frame_current
    for frame, pose in enumerate(zip(rotations, translations, expressions)):
        set_pose(armature, source, *pose)
        key_pose(armature, source, first + frame)
    scene.frame_end = max(first + len(rotations) - 1, first)
    scene.frame_set(first)
    return len(rotations)


@bpy.app.handlers.persistent
def extract_all(scene, *_):
    """Follows the frame: every avatar of the scene that is to."""
    for armature in scene.objects:
        if armature.type == "ARMATURE" and armature.xavatar.avatar and armature.xavatar.follows:
            extract(armature)


# --- What the user sees -------------------------------------------------------------------------------------------------------------


class AvatarSettings(bpy.types.PropertyGroup):
    """What an armature knows of its avatar."""

    avatar: bpy.props.StringProperty(name="Avatar", subtype="FILE_PATH")
    body: bpy.props.StringProperty(name="Body", subtype="FILE_PATH")
    resolution: bpy.props.IntProperty(name="Resolution", default=128, min=16, max=256, description="Cells along the longest side")
    follows: bpy.props.BoolProperty(name="Follow the frame", default=True, description="Extract the surface when the frame changes")
    expression: bpy.props.FloatVectorProperty(name="Expression", size=EXPRESSIONS, soft_min=-3, soft_max=3)
    mesh: bpy.props.PointerProperty(type=bpy.types.Object)


class AvatarPreferences(bpy.types.AddonPreferences):
    """Where the program is."""

    bl_idname = __name__
    program: bpy.props.StringProperty(
        name="Program", subtype="FILE_PATH", description="The program xavatar, to be used instead of the module"
    )

    def draw(self, _context):
        self.layout.prop(self, "program")


class Reporting:
    """Operators that tell the user what failed."""

    def execute(self, context):
        try:
            self.act(context)
        except Exception as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class ImportAvatar(Reporting, bpy.types.Operator, ImportHelper):
    """Load an avatar.safetensors with an armature"""

    bl_idname = "import_scene.xavatar"
    bl_label = "xavatar avatar"
    bl_options = {"UNDO"}
    filter_glob: bpy.props.StringProperty(default="*.safetensors", options={"HIDDEN"})
    body: bpy.props.StringProperty(name="Body", description="The body model's file or folder; the demo's avatar needs none")
    resolution: bpy.props.IntProperty(name="Resolution", default=128, min=16, max=256)

    def act(self, _context):
        add_avatar(self.filepath, self.body, self.resolution)


class ImportMotion(Reporting, bpy.types.Operator, ImportHelper):
    """Put a motion on the armature: AMASS, BVH, pose estimators', or any other that xavatar reads"""

    bl_idname = "xavatar.import_motion"
    bl_label = "Import motion"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        return avatar_of(context) is not None

    def act(self, context):
        add_motion(avatar_of(context), self.filepath)


class ExtractSurface(Reporting, bpy.types.Operator):
    """Make the surface of the armature's pose from the avatar's fields"""

    bl_idname = "xavatar.extract"
    bl_label = "Extract"

    @classmethod
    def poll(cls, context):
        return avatar_of(context) is not None

    def act(self, context):
        extract(avatar_of(context))


class AvatarPanel(bpy.types.Panel):
    """The avatar of the armature or mesh that is active."""

    bl_label = "xavatar"
    bl_idname = "VIEW3D_PT_xavatar"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "xavatar"

    def draw(self, context):
        armature = avatar_of(context)
        if armature is None:
            self.layout.operator(ImportAvatar.bl_idname, text="Import an avatar")
            return
        self.layout.prop(armature.xavatar, "resolution")
        self.layout.prop(armature.xavatar, "follows")
        self.layout.prop(armature.xavatar, "expression")
        self.layout.operator(ExtractSurface.bl_idname)
        self.layout.operator(ImportMotion.bl_idname)


def avatar_of(context):
    """The active avatar's armature."""
    active = context.active_object
    for candidate in (active, active.parent if active else None):
        if candidate is not None and candidate.type == "ARMATURE" and candidate.xavatar.avatar:
            return candidate
    return None


def import_entry(menu, _context):
    """The line of the menu."""
    menu.layout.operator(ImportAvatar.bl_idname, text="xavatar avatar (.safetensors)")


CLASSES = (AvatarSettings, AvatarPreferences, ImportAvatar, ImportMotion, ExtractSurface, AvatarPanel)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Object.xavatar = bpy.props.PointerProperty(type=AvatarSettings)
    bpy.types.TOPBAR_MT_file_import.append(import_entry)
    bpy.app.handlers.frame_change_post.append(extract_all)


def unregister():
    bpy.app.handlers.frame_change_post.remove(extract_all)
    bpy.types.TOPBAR_MT_file_import.remove(import_entry)
    del bpy.types.Object.xavatar
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
    SOURCES.clear()


if __name__ == "__main__":
    register()
