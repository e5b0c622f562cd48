"""Runs inside Blender: renders what `exchange.py` wrote, with Cycles.

    stdin   paths of requests (JSON), one on a line; the end of it ends Blender
    stdout  `vid2ev: VERSION` at the beginning, `vid2ev: done` after each request; other lines are Blender's own

A request is in the camera's coordinates.  Each of its passes becomes a multi-layer EXR of 32 bits, whole or not there:

    geometry  depth z and the number of the thing + 1, through the very centres of the pixels
    light     red, green and blue, as a mean over the pixels, by the lamps that the pass names

What Blender keeps from one request to the next are things that look the same.

Source: Blender's Python API 5.0; the lamps' units are those of Cycles, in which a white diffuse surface has light
power / (4 pi^2 d^2) at the distance d of a point lamp, and strength / pi in the light of a sun.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
from pathlib import Path

import numpy as np

with contextlib.suppress(ImportError):  # (it is there inside Blender only)
    import bpy

NEAREST_M, FARTHEST_M = 1e-4, 1e6
SENSOR_MM = 36.0
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # Blender's cameras look along -z, with y up
TO_EQUIRECTANGULAR = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # Blender's sky has z up and its middle at x


def main() -> None:
    """Answer requests until there are no more."""
    print(f"vid2ev: {bpy.app.version_string}", flush=True)  # (first: an old one fails at the rest)
    stage = Stage()
    for line in sys.stdin:
        answer(stage, Path(line.rstrip("\n")))
        print("vid2ev: done", flush=True)


def answer(stage: Stage, path: Path) -> None:
    """Render the passes of a request that are not there yet."""
    request = json.loads(path.read_text(encoding="utf-8"))
    stage.set_up(request, path.parent)
    for render in request["passes"]:
        there = path.parent / render["answer"]
        if not there.exists():
            stage.light(request, render)
            stage.render(request, render, there)


class Stage:
    """Blender's scene: camera, things, lamps and sky."""

    def __init__(self) -> None:
        self.scene = bpy.context.scene
        for thing in list(bpy.data.objects):  # (Blender begins with a cube)
            remove(thing)
        self.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.scene.collection.objects.link(self.camera)
        place(self.camera, FLIP)
        self.scene.camera = self.camera
        self.things: list[Thing] = []
        self.lamps: list = []
        self.store = Store()
        self.sky = Sky(self.scene, self.store)
        set_up_cycles(self.scene)

    def set_up(self, request: dict, folder: Path) -> None:
        """Put everything in its place."""
        self.store.folder = folder
        aim(self.scene, self.camera.data, request)
        for number, asked in enumerate(request["things"]):
            look = {key: value for key, value in asked.items() if key not in ("pose", "light")}
            if number == len(self.things):
                self.things.append(Thing(self.scene, number))
            self.things[number].become(look, self.store)
            place(self.things[number].object, np.array(asked["pose"]))
        while len(self.things) > len(request["things"]):
            self.things.pop().leave()
        self.sky.become(request["sky"])
        for lamp in self.lamps:
            remove(lamp)
        self.lamps = [new_lamp(self.scene, asked) for asked in request["lamps"]]

    def light(self, request: dict, render: dict) -> None:
        """Leave on what the pass asks for."""
        around = render["around"]
        for thing, asked in zip(self.things, request["things"], strict=True):
            thing.glow.inputs[1].default_value = asked["light"] if around else (0, 0, 0)
        self.sky.switch(around)
        for number, lamp in enumerate(self.lamps):
            lamp.hide_render = number not in render["lamps"]

    def render(self, request: dict, render: dict, path: Path) -> None:
        """One pass into its file."""
        geometry = render["kind"] == "geometry"
        cycles, layer = self.scene.cycles, self.scene.view_layers[0]
        cycles.samples = 1 if geometry else request["samples"]
        # (a Gaussian of a hundredth of a pixel: rays go through the centres; the box is the mean over the pixel)
        cycles.pixel_filter_type, cycles.filter_width = ("GAUSSIAN", 0.01) if geometry else ("BOX", 1.0)
        layer.use_pass_z = layer.use_pass_object_index = geometry
        layer.use_pass_combined = not geometry
        beside = path.with_name(f"new.{path.name}")
        self.scene.render.filepath = str(beside)
        bpy.ops.render.render(write_still=True)
        os.replace(beside, path)


class Thing:
    """A mesh with a material."""

    def __init__(self, scene, number: int):  # type: ignore[no-untyped-def]
        self.look: dict = {}
        self.material = bpy.data.materials.new(f"thing {number}")
        self.material.use_nodes = True
        self.material.cycles.emission_sampling = "NONE"
        self.object = bpy.data.objects.new(f"thing {number}", bpy.data.meshes.new("none"))
        self.object.pass_index = number + 1
        scene.collection.objects.link(self.object)

    def become(self, look: dict, store: Store) -> None:
        """Take another mesh and material, if they are others."""
        if look == self.look:
            return
        self.object.data = store.mesh(look["mesh"])
        if not self.object.data.materials:
            self.object.data.materials.append(None)
        self.object.material_slots[0].link = "OBJECT"
        self.object.material_slots[0].material = self.material
        self.glow = look_like(self.material.node_tree, look, store)
        self.look = look

    def leave(self) -> None:
        remove(self.object)
        bpy.data.materials.remove(self.material)


class Store:
    """Meshes and pictures, read once."""

    folder: Path

    def __init__(self) -> None:
        self.meshes: dict = {}
        self.pictures: dict = {}

    def mesh(self, name: str):  # type: ignore[no-untyped-def]
        if name not in self.meshes:
            self.meshes[name] = new_mesh(np.load(self.folder / name))
        return self.meshes[name]

    def picture(self, name: str):  # type: ignore[no-untyped-def]
        if name not in self.pictures:
            self.pictures[name] = new_picture(np.load(self.folder / name))
        return self.pictures[name]


class Sky:
    """The background, of one colour (seen, but without light of its own) or a picture that lights things, too."""

    def __init__(self, scene, store: Store):  # type: ignore[no-untyped-def]
        self.world, self.store = bpy.data.worlds.new("sky"), store
        self.look: dict = {}
        self.world.use_nodes = True
        scene.world = self.world

    def become(self, look: dict) -> None:
        """Take another colour or picture, or turn the one that there is."""
        if look == self.look:
            return
        tree, self.look = self.world.node_tree, look
        tree.nodes.clear()
        background, out = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
        tree.links.new(background.outputs["Background"], out.inputs["Surface"])
        if look["texture"] is None:
            self.world.cycles.sampling_method = "NONE"
            colour = tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
        else:
            self.world.cycles.sampling_method = "AUTOMATIC"
            around = tree.nodes.new("ShaderNodeTexEnvironment")
            around.image = self.store.picture(look["texture"])
            turn = TO_EQUIRECTANGULAR @ np.array(look["turn"])
            tree.links.new(turned(tree, turn), around.inputs["Vector"])
            colour = around.outputs["Color"]
        product = times(tree, colour, look["light"])
        tree.links.new(product, background.inputs["Color"])
        self.strength = background.inputs["Strength"]

    def switch(self, on: bool) -> None:
        """On or off."""
        self.strength.default_value = float(on)


def set_up_cycles(scene) -> None:  # type: ignore[no-untyped-def]
    """No light from thing to thing, no noise but that of places in the pixel, linear EXR with 32 bits."""
    render = scene.render
    render.engine = "CYCLES"  # (as a module, Blender loads it only now)
    cycles = scene.cycles
    cycles.device = "CPU"
    render.use_persistent_data, render.film_transparent, render.use_motion_blur = True, False, False
    render.use_compositing = render.use_sequencer = False
    render.resolution_percentage, render.dither_intensity = 100, 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.light_sampling_threshold, cycles.seed, cycles.sampling_pattern = 0, 0, "TABULATED_SOBOL"
    scene.view_settings.view_transform = "Raw"
    settings = render.image_settings
    if hasattr(settings, "media_type"):  # (from Blender 5.0 on)
        settings.media_type = "MULTI_LAYER_IMAGE"
    if hasattr(settings, "use_exr_interleave"):  # (in several parts, 5.0 writes no pixels that are not square)
        settings.use_exr_interleave = True
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"


def aim(scene, lens, request: dict) -> None:  # type: ignore[no-untyped-def]
    """Focal lengths and principal point; shifts are in widths of the picture, from the middle, y up."""
    (width, height), (fx, fy), (cx, cy) = request["size"], request["focal_px"], request["centre_px"]
    render = scene.render
    render.resolution_x, render.resolution_y = width, height
    # (the taller the pixel, the shorter the focal length down; Blender wants neither side below 1)
    render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, fy / fx), max(1.0, fx / fy)
    lens.sensor_fit, lens.sensor_width, lens.lens = "HORIZONTAL", SENSOR_MM, fx * SENSOR_MM / width
    lens.shift_x = ((width - 1) / 2 - cx) / width
    lens.shift_y = (cy - (height - 1) / 2) * (fx / fy) / width
    lens.clip_start, lens.clip_end = NEAREST_M, FARTHEST_M
    render.threads_mode = "FIXED" if request["threads"] else "AUTO"
    if request["threads"]:
        render.threads = request["threads"]


def new_lamp(scene, asked: dict):  # type: ignore[no-untyped-def]
    """A point without extent, or a sun that is one, in Cycles' units."""
    lamp = bpy.data.lights.new("lamp", "POINT" if asked["kind"] == "point" else "SUN")
    strongest = max(asked["colour"])
    lamp.color = [part / strongest if strongest > 0 else 0.0 for part in asked["colour"]]
    lamp.use_shadow = asked["shadows"]
    there = bpy.data.objects.new("lamp", lamp)
    if asked["kind"] == "point":
        lamp.energy = 4 * math.pi**2 * asked["reach_m"] ** 2 * strongest
        lamp.shadow_soft_size, lamp.use_soft_falloff = 0.0, False
        there.location = asked["place"]
    else:
        lamp.energy, lamp.angle = math.pi * strongest, 0.0
        place(there, facing(np.array(asked["place"])))
    scene.collection.objects.link(there)
    return there


def facing(direction: np.ndarray) -> np.ndarray:
    """A matrix [4, 4] that turns -z into a direction of unit length."""
    z = -direction
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return matrix


def new_mesh(arrays):  # type: ignore[no-untyped-def]
    """A mesh of `exchange.py`: triangles with (u, v), normals and colours of their corners."""
    vertices, triangles = arrays["vertices"], arrays["triangles"]
    mesh, count = bpy.data.meshes.new("mesh"), len(triangles)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    mesh.uv_layers.new(name="uv").data.foreach_set("uv", arrays["uv"].astype(np.float32).ravel())
    colours = np.concatenate([arrays["colours"].reshape(-1, 3), np.ones((3 * count, 1))], axis=1)
    attribute = mesh.attributes.new("colour", "FLOAT_COLOR", "CORNER")
    attribute.data.foreach_set("color", colours.astype(np.float32).ravel())
    smooth = len(arrays["normals"]) > 0
    mesh.polygons.foreach_set("use_smooth", np.full(count, smooth))
    mesh.update()
    if smooth:
        mesh.normals_split_custom_set(arrays["normals"].reshape(-1, 3).tolist())
    return mesh


def new_picture(pixels: np.ndarray):  # type: ignore[no-untyped-def]
    """Linear light [H, W, 3] as it is; Blender counts rows from below."""
    height, width = pixels.shape[:2]
    picture = bpy.data.images.new("picture", width, height, float_buffer=True, is_data=True)
    picture.use_half_precision = False
    whole = np.ones((height, width, 4), np.float32)
    whole[..., :3] = pixels[::-1]
    picture.pixels.foreach_set(whole.ravel())
    picture.update()
    return picture


def look_like(tree, look: dict, store: Store):  # type: ignore[no-untyped-def]
    """The nodes of a material; gives the node whose second input is the light from everywhere and the thing's own.

    light = albedo (lamps + glow) + highlight
    """
    new, link = tree.nodes.new, tree.links.new
    tree.nodes.clear()
    corners = new("ShaderNodeAttribute")
    corners.attribute_name = "colour"
    albedo = times(tree, corners.outputs["Color"], look["colour"])
    if look["texture"] is not None:
        albedo = times(tree, on_surface(tree, look, store), albedo)
    diffuse, glow, camera, out = (
        new(f"ShaderNode{name}") for name in ("BsdfDiffuse", "Emission", "LightPath", "OutputMaterial")
    )
    link(albedo, diffuse.inputs["Color"])
    product = times(tree, albedo, (0, 0, 0))
    link(product, glow.inputs["Color"])
    link(camera.outputs["Is Camera Ray"], glow.inputs["Strength"])
    sum_ = plus(tree, diffuse.outputs["BSDF"], glow.outputs["Emission"])
    if look["specular"] > 0:
        sum_ = plus(tree, sum_, highlight(tree, look["specular"], look["shininess"]))
    link(sum_, out.inputs["Surface"])
    return product.node


def highlight(tree, specular: float, shininess: float):  # type: ignore[no-untyped-def]
    """The microfacets whose highlight has the exponent of Blinn and Phong, and at its peak their height.

    Of M. Ashikhmin, P. Shirley, "An anisotropic Phong BRDF model", 2000: (s + 1) / (8 pi) cos(half)^s, times pi for
    light that is relative to white.
    """
    glossy = tree.nodes.new("ShaderNodeBsdfGlossy")
    glossy.distribution = "ASHIKHMIN_SHIRLEY"
    glossy.inputs["Roughness"].default_value = (2 / (shininess + 2)) ** 0.25
    height = 8 * specular / (shininess + 1)
    glossy.inputs["Color"].default_value = (height, height, height, 1)
    return glossy.outputs["BSDF"]


def on_surface(tree, look: dict, store: Store):  # type: ignore[no-untyped-def]
    """The colour of the thing's picture."""
    uv, repeated = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeVectorMath")
    uv.uv_map, repeated.operation = "uv", "MULTIPLY_ADD"
    tree.links.new(uv.outputs["UV"], repeated.inputs[0])
    repeated.inputs[1].default_value = (*look["scale"], 1)
    repeated.inputs[2].default_value = (*look["offset"], 0)
    picture = tree.nodes.new("ShaderNodeTexImage")
    picture.image, picture.interpolation, picture.extension = store.picture(look["texture"]), "Linear", "REPEAT"
    tree.links.new(repeated.outputs["Vector"], picture.inputs["Vector"])
    return picture.outputs["Color"]


def times(tree, colour, other):  # type: ignore[no-untyped-def]
    """The product of colours, unclipped."""
    product = tree.nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    tree.links.new(colour, product.inputs[0])
    if isinstance(other, list | tuple):
        product.inputs[1].default_value = other
    else:
        tree.links.new(other, product.inputs[1])
    return product.outputs["Vector"]


def plus(tree, first, second):  # type: ignore[no-untyped-def]
    """The sum of two shaders."""
    sum_ = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(first, sum_.inputs[0])
    tree.links.new(second, sum_.inputs[1])
    return sum_.outputs["Shader"]


def turned(tree, matrix: np.ndarray):  # type: ignore[no-untyped-def]
    """The direction of a ray of the sky, times a matrix."""
    ray, joined = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeCombineXYZ")
    for number, row in enumerate(matrix.tolist()):
        along = tree.nodes.new("ShaderNodeVectorMath")
        along.operation = "DOT_PRODUCT"
        tree.links.new(ray.outputs["Generated"], along.inputs[0])
        along.inputs[1].default_value = row
        tree.links.new(along.outputs["Value"], joined.inputs[number])
    return joined.outputs["Vector"]


def place(thing, matrix: np.ndarray) -> None:  # type: ignore[no-untyped-def]
    """Put an object where a matrix [4, 4] leads to; Blender takes lists of columns."""
    thing.matrix_world = matrix.T.tolist()


def remove(thing) -> None:  # type: ignore[no-untyped-def]
    """Take an object away, and a lamp's data with it."""
    data = thing.data
    bpy.data.objects.remove(thing)
    if isinstance(data, bpy.types.Light):
        bpy.data.lights.remove(data)


if __name__ == "__main__":
    main()
