"""Materials of Blender as those of echocast: what their node trees say about the surface, read as a glTF exporter would,
and approximated where a scanner has no use for more. What is approximated is reported, once per material."""

import functools
import math
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import echocast as ec
import numpy as np
from mathutils import Euler, Matrix

from . import srgb

#: Custom properties of materials that are keys of materials of echocast.
KEYS = (
    "reflectance",
    "scattering",
    "sound",
    "radar",
    "alpha",
    "alpha_cutoff",
    "dirt",
    "pane_m",
    "group_index",
    "extinction_index",
    "ior",
    "metallic",
    "source",
)
#: Those of the paper's add-on, and the keys that they stand for.
PAPER_KEYS = {"blainder_metallic": "metallic", "blainder_ior": "ior"}

#: Most pixels per side.
LONGEST_SIDE = 16384

#: Shaders that are read as diffuse surfaces of their colour.
DIFFUSE = ("BSDF_DIFFUSE", "BSDF_TRANSLUCENT", "SUBSURFACE_SCATTERING", "BSDF_SHEEN", "BSDF_VELVET", "BSDF_TOON", "EMISSION")

#: The longest chain of nodes that is followed.
DEEPEST = 64


@dataclass
class Image:
    """An image on a surface."""

    image: Any
    #: The UV map; None: the one that is rendered.
    uv_map: "str | None" = None
    #: 3 x 3, from texture coordinates to those of the image.
    matrix: Any = None
    #: As echocast has it, or "clip": beyond its edges there is nothing.
    wrap: str = "repeat"
    filter: str = "linear"
    #: Whether its alpha is used, or its colours.
    alpha: bool = False


@dataclass
class Surface:
    """What the nodes of a material amount to."""

    color: "tuple[float, float, float]" = (0.8, 0.8, 0.8)
    image: "Image | None" = None
    alpha: float = 1.0
    alpha_image: "Image | None" = None
    metallic: float = 0.0
    roughness: float = 0.5
    ior: float = 1.45
    transmission: float = 0.0


@dataclass
class Read:
    """A material of echocast, and what geometry needs to know of it."""

    material: ec.Material
    #: Whether it has an image, and on which UV map; None: the one that is rendered.
    has_image: bool = False
    uv_map: "str | None" = None
    #: The part of an object that its faces are.
    part: "str | None" = None
    notes: "list[str]" = field(default_factory=list)


def read(material: "bpy.types.Material | None") -> Read:
    """Reads a material; None: that of faces without one."""
    if material is None:
        return Read(ec.Material({"name": "no material", "base_color": [0.8, 0.8, 0.8]}))
    notes = Notes(material.name)
    # Before Blender 5.0 a material may have no nodes.
    tree = material.node_tree if bpy.app.version >= (5, 0) or material.use_nodes else None
    if tree is None:
        surface = Surface(tuple(material.diffuse_color[:3]), alpha=material.diffuse_color[3])
        surface.metallic, surface.roughness = material.metallic, material.roughness
    else:
        surface = tree_surface(tree, notes)
    keys: "dict[str, Any]" = {
        "name": material.name,
        "base_color": [*(unit(channel) for channel in surface.color), unit(surface.alpha)],
        "metallic": unit(surface.metallic),
        "roughness": unit(surface.roughness),
        "transmission": unit(surface.transmission),
        "ior": max(1.0, surface.ior),
    }
    cutoff = clip_threshold(material)
    blend = surface.alpha < 1 or surface.alpha_image is not None
    if blend and cutoff is not None:
        keys.update(alpha="cutout", alpha_cutoff=unit(cutoff))
        blend = False
    own = own_keys(material, notes)
    options, used = images(surface, notes)
    try:
        made = ec.Material({**keys, **own}, blend=blend and "alpha" not in own, **options)
    except (ec.Error, TypeError) as error:
        notes.add(f"its custom properties are not used: {error}")
        made = ec.Material(keys, blend=blend, **options)
    part = material.get("partID")
    uv_map = used.uv_map if used else None
    return Read(made, used is not None, uv_map, None if part is None else label(part), notes.sentences())


def own_keys(material: "bpy.types.Material", notes: "Notes") -> "dict[str, Any]":
    """Keys of materials of echocast among the custom properties."""
    own = {key: plain(material[key]) for key in KEYS if key in material}
    # A number that is called alpha, or a sound or radar without keys, has another purpose.
    for key, kind in (("alpha", str), ("sound", dict), ("radar", dict)):
        if not isinstance(own.get(key, kind()), kind):
            del own[key]
    for key, name in PAPER_KEYS.items():
        # The paper's add-on writes an index of 0 for what does not refract.
        if key in material and not (key == "blainder_ior" and material[key] == 0):
            own[name] = plain(material[key])
    if "blainder_rgba" in material and "reflectance" not in own:
        rgba = plain(material["blainder_rgba"])
        if isinstance(rgba, list) and len(rgba) == 4:
            own["reflectance"] = rgba[3]
        else:
            notes.add(f"blainder_rgba is {rgba!r}; allowed: four numbers")
    return own


class Notes:
    """What is approximated in a material, and what has been read of its nodes."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.said: "dict[str, None]" = {}
        #: What was read, by reader, socket and the group nodes around it.
        self.known: "dict[tuple[Any, ...], Any]" = {}
        #: How many readers are waiting for others.
        self.depth = 0

    def add(self, sentence: str) -> None:
        self.said[sentence] = None

    def sentences(self) -> "list[str]":
        return [f"material {self.name}: {sentence}" for sentence in self.said]


def label(value: Any) -> str:
    """A label as text: 7.0 is 7."""
    value = plain(value)
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def plain(value: Any) -> Any:
    """The value of a custom property as plain Python."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "to_list"):
        return value.to_list()
    if isinstance(value, bpy.types.ID):
        return value.name
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def unit(value: float) -> float:
    return min(1.0, max(0.0, float(value))) if math.isfinite(value) else 0.0


def clip_threshold(material: "bpy.types.Material") -> "float | None":
    """The least alpha that is seen, if the material is a cut-out. 4.2 and later have nodes for that instead."""
    clipped = getattr(material, "blend_method", "") == "CLIP"
    return material.alpha_threshold if clipped else None


# --- nodes ------------------------------------------------------------------------------------------------------------


class TooDeep(Exception):
    """Nodes are linked in a circle, or in too long a chain."""


def once(reader: Any) -> Any:
    """Makes a reader of sockets read each once, however many paths lead to it."""

    @functools.wraps(reader)
    def read_once(socket: Any, groups: "tuple[Any, ...]", notes: Notes) -> Any:
        key = (reader, socket.as_pointer(), *(group.as_pointer() for group in groups))
        if key not in notes.known:
            if notes.depth == DEEPEST:
                raise TooDeep
            notes.depth += 1
            notes.known[key] = reader(socket, groups, notes)
            notes.depth -= 1
        return notes.known[key]

    return read_once


def tree_surface(tree: "bpy.types.NodeTree", notes: Notes) -> Surface:
    output = tree.get_output_node("ALL")
    try:
        surface = shader(output.inputs["Surface"], (), notes) if output else None
    except TooDeep:
        notes.add(f"its nodes are linked in a circle, or more than {DEEPEST} in a chain: grey")
        return Surface()
    if surface is None:
        notes.add("its node tree has no surface: grey")
    return surface or Surface()


def source(socket: Any, groups: "tuple[Any, ...]") -> "tuple[Any, tuple[Any, ...]]":
    """Where an input has its value from: the output of a node, or the input whose own value it is; past reroutes and what
    is muted, and into and out of `groups`, the group nodes around it."""
    for _ in range(DEEPEST):
        link = next((link for link in socket.links if not link.is_muted), None)
        if link is None:
            return socket, groups
        node, linked, inside = link.from_node, link.from_socket, groups
        if node.mute:
            following = next((pair.from_socket for pair in node.internal_links if pair.to_socket == linked), None)
        elif node.type == "REROUTE":
            following = node.inputs[0]
        elif node.type == "GROUP" and node.node_tree:
            output = next((one for one in node.node_tree.nodes if one.type == "GROUP_OUTPUT" and one.is_active_output), None)
            following = by_identifier(output.inputs, linked.identifier) if output else None
            inside = (*groups, node)
        elif node.type == "GROUP_INPUT" and groups:
            following = by_identifier(groups[-1].inputs, linked.identifier)
            inside = groups[:-1]
        else:
            return linked, groups
        if following is None:
            return socket, groups
        socket, groups = following, inside
    raise TooDeep


def by_identifier(sockets: Any, identifier: str) -> Any:
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def socket_of(node: Any, *names: str) -> Any:
    """The first of the inputs `names` that the node has in this version of Blender."""
    return next((node.inputs[name] for name in names if name in node.inputs), None)


@once
def shader(socket: Any, groups: "tuple[Any, ...]", notes: Notes) -> "Surface | None":
    """What the shader that is linked to an input amounts to; None: there is none."""
    linked, groups = source(socket, groups)
    if not linked.is_output:
        return None
    node = linked.node
    kind = node.type

    def number_of(*names: str, default: float) -> float:
        found = socket_of(node, *names)
        return default if found is None else number(found, groups, notes)

    if kind == "BSDF_PRINCIPLED":
        surface = Surface(ior=number_of("IOR", default=1.45), roughness=number_of("Roughness", default=0.5))
        surface.metallic = number_of("Metallic", default=0.0)
        surface.transmission = number_of("Transmission Weight", "Transmission", default=0.0)
        surface.color, surface.image = color(node.inputs["Base Color"], groups, notes)
        surface.alpha, surface.alpha_image = alpha(node.inputs["Alpha"], groups, notes)
        return surface
    if kind in DIFFUSE:
        found, image = color(node.inputs["Color"], groups, notes)
        if kind == "EMISSION":
            notes.add("light that it emits is not seen: its colour is taken as that of a diffuse surface")
        return Surface(found, image, roughness=1.0)
    if kind in ("BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC"):
        found, image = color(socket_of(node, "Color", "Base Color"), groups, notes)
        return Surface(found, image, metallic=1.0, roughness=number_of("Roughness", default=0.5))
    if kind in ("BSDF_GLASS", "BSDF_REFRACTION"):
        found, image = color(node.inputs["Color"], groups, notes)
        rough = number_of("Roughness", default=0.0)
        return Surface(found, image, transmission=1.0, roughness=rough, ior=number_of("IOR", default=1.45))
    if kind == "BSDF_TRANSPARENT":
        return Surface((1.0, 1.0, 1.0), alpha=0.0)
    if kind == "HOLDOUT":
        return Surface((0.0, 0.0, 0.0))
    if kind == "MIX_SHADER":
        return mixed(node, groups, notes)
    if kind == "ADD_SHADER":
        return added(node, groups, notes)
    notes.add(f"the node {node.name} is not read: grey")
    return Surface()


def mixed(node: Any, groups: "tuple[Any, ...]", notes: Notes) -> "Surface | None":
    """A mix of two shaders. With a transparent one it is the other with an alpha."""
    first, second = (shader(socket, groups, notes) for socket in node.inputs[1:3])
    if first is None or second is None:
        return first or second
    factor, image = alpha(node.inputs[0], groups, notes)
    if image is None and factor in (0.0, 1.0):
        return second if factor else first
    clear = [part.alpha == 0.0 and part.alpha_image is None for part in (first, second)]
    if clear[0] and not clear[1] and not (image and second.alpha_image):
        return replace(second, alpha=second.alpha * factor, alpha_image=second.alpha_image or image)
    if clear[1] and not clear[0] and image is None:
        return replace(first, alpha=first.alpha * (1 - factor))
    share = factor if image is None else 0.5
    notes.add(f"the mix at the node {node.name} is approximated by one surface in between")
    between: Any = lambda a, b: a + share * (b - a)
    larger = first if share < 0.5 else second
    return Surface(
        color=tuple(between(a, b) for a, b in zip(first.color, second.color)),
        image=larger.image,
        alpha=between(first.alpha, second.alpha),
        alpha_image=larger.alpha_image,
        metallic=between(first.metallic, second.metallic),
        roughness=between(first.roughness, second.roughness),
        ior=larger.ior,
        transmission=between(first.transmission, second.transmission),
    )


def added(node: Any, groups: "tuple[Any, ...]", notes: Notes) -> "Surface | None":
    """A sum of two shaders: the first of them that does not only emit light."""
    emits = lambda socket: source(socket, groups)[0].node.type == "EMISSION"
    linked = [socket for socket in node.inputs if source(socket, groups)[0].is_output]
    if len(linked) == 2:
        notes.add(f"of the sum at the node {node.name} one shader is used")
    return shader(min(linked, key=emits), groups, notes) if linked else None


@once
def number(socket: Any, groups: "tuple[Any, ...]", notes: Notes) -> float:
    """The value at an input: a number, or the mean of the image that is linked to it."""
    linked, groups = source(socket, groups)
    node = linked.node
    if not linked.is_output or node.type in ("VALUE", "RGB"):
        return scalar(linked)
    if node.type == "TEX_IMAGE" and node.image and is_readable(node.image):
        mean = mean_color(node.image)
        notes.add(f"the mean of the image {node.image.name} is used for {socket.name}")
        return mean[3] if linked.name == "Alpha" else luminance(mean)
    if node.type in ("MATH", "CLAMP", "MAP_RANGE", "SEPARATE_COLOR", "SEPRGB", "VALTORGB", "INVERT"):
        inner = next((inner for inner in node.inputs if inner.is_linked), None)
        if inner is not None:
            notes.add(f"the node {node.name} is passed over for {socket.name}")
            return number(inner, groups, notes)
    notes.add(f"the node {node.name} is not read: {socket.name} is {scalar(socket):.3g}")
    return scalar(socket)


def scalar(socket: Any) -> float:
    """The own value of a socket as a number, as Blender converts it."""
    value = getattr(socket, "default_value", 0.0)
    if isinstance(value, (bool, int, float)):
        return float(value)
    return luminance(value) if socket.type == "RGBA" else sum(value[:3]) / 3


def luminance(channels: Any) -> Any:
    """Rec. ITU-R BT.709, of the last axis."""
    return np.asarray(channels)[..., :3] @ np.array([0.2126, 0.7152, 0.0722])


@once
def color(socket: Any, groups: "tuple[Any, ...]", notes: Notes) -> "tuple[tuple[float, float, float], Image | None]":
    """The colour at an input: a factor, and the image that it multiplies."""
    linked, groups = source(socket, groups)
    node = linked.node
    if not linked.is_output or node.type in ("VALUE", "RGB"):
        return rgb(linked), None
    if node.type == "TEX_IMAGE":
        return image_color(node, groups, notes)
    if node.type in ("MIX_RGB", "MIX"):
        return mixed_colors(node, groups, notes)
    if node.type in ("HUE_SAT", "BRIGHTCONTRAST", "GAMMA", "CURVE_RGB", "INVERT"):
        notes.add(f"the node {node.name} is passed over")
        return color(node.inputs["Color"], groups, notes)
    notes.add(f"the node {node.name} is not read: {socket.name} is that of the socket")
    return rgb(socket), None


def mixed_colors(node: Any, groups: "tuple[Any, ...]", notes: Notes) -> "tuple[tuple[float, float, float], Image | None]":
    factor, *both = [inner for inner in node.inputs if inner.enabled][:3]
    share = unit(number(factor, groups, notes))
    (a, image_a), (b, image_b) = (color(inner, groups, notes) for inner in both)
    kind = node.blend_type if getattr(node, "data_type", "RGBA") == "RGBA" else "MIX"
    if share == 0:
        return a, image_a
    if kind == "MIX" and share == 1:
        return b, image_b
    if kind == "MULTIPLY" and (image_b is None or image_a is None and share == 1):
        return tuple(x * (1 - share + share * y) for x, y in zip(a, b)), image_a or image_b
    if kind == "MIX" and image_a is None and image_b is None:
        return tuple(x + share * (y - x) for x, y in zip(a, b)), None
    notes.add(f"the mix of colours at the node {node.name} is approximated by the larger share")
    return (b, image_b) if share > 0.5 else (a, image_a)


def rgb(socket: Any) -> "tuple[float, float, float]":
    """The own value of a socket as a colour."""
    value: Any = getattr(socket, "default_value", 0.0)
    red, green, blue = value[:3] if hasattr(value, "__len__") else (value,) * 3
    return float(red), float(green), float(blue)


@once
def alpha(socket: Any, groups: "tuple[Any, ...]", notes: Notes) -> "tuple[float, Image | None]":
    """The alpha at an input: a factor, and the image that it multiplies."""
    linked, inside = source(socket, groups)
    node = linked.node
    if linked.is_output and node.type == "TEX_IMAGE" and node.image:
        _, image = image_color(node, inside, notes)
        if image is not None:
            return 1.0, replace(image, alpha=linked.name == "Alpha")
    elif linked.is_output and node.type == "MATH" and node.operation in ("GREATER_THAN", "ROUND", "MULTIPLY"):
        found, image = alpha(node.inputs[0], inside, notes)
        if image is not None:
            # Where there are only two values, a threshold changes nothing.
            return found * (number(node.inputs[1], inside, notes) if node.operation == "MULTIPLY" else 1.0), image
    return number(socket, groups, notes), None


def image_color(node: Any, groups: "tuple[Any, ...]", notes: Notes) -> "tuple[tuple[float, float, float], Image | None]":
    """The colour of an image node: white times its image, or the mean of it."""
    white = (1.0, 1.0, 1.0)
    image = node.image
    if image is None:
        notes.add(f"the node {node.name} has no image: it is pink in Blender, white here")
        return white, None
    if not is_readable(image):
        notes.add(f"the image {image.name} cannot be read, or has more than {LONGEST_SIDE} pixels a side: white")
        return white, None
    place = coordinates(node.inputs["Vector"], groups, notes)
    why = "its coordinates are not those of a UV map" if place is None else None
    if image.source not in ("FILE", "GENERATED"):
        why = f"it is {image.source.lower()}"
    elif node.projection != "FLAT":
        why = f"its projection is {node.projection.lower()}"
    if place is None or why is not None:
        notes.add(f"the mean of the image {image.name} is used, as {why}")
        return mean_color(image)[:3], None
    uv_map, matrix = place
    # There is no room for an edge around the largest images.
    clips = max(image.size) + 2 <= LONGEST_SIDE
    wraps = {"EXTEND": "clamp_to_edge", "CLIP": "clip" if clips else "clamp_to_edge", "MIRROR": "mirrored_repeat"}
    nearest = node.interpolation == "Closest"
    return white, Image(image, uv_map, matrix, wraps.get(node.extension, "repeat"), "nearest" if nearest else "linear")


def coordinates(socket: Any, groups: "tuple[Any, ...]", notes: Notes) -> "tuple[str | None, Any] | None":
    """The UV map that is linked to a vector input, None: the one that is rendered, and the 3 x 3 matrix in between; None:
    other coordinates."""
    # In three dimensions: the first of several nodes may turn u and v out of their plane, and the next one back.
    matrix = np.eye(4)
    while True:
        linked, groups = source(socket, groups)
        node = linked.node
        if node.type == "MAPPING" and linked.is_output:
            step = mapping(node, notes)
            if step is None:
                return None
            matrix = matrix @ step
            socket = node.inputs["Vector"]
            continue
        in_plane = matrix[np.ix_((0, 1, 3), (0, 1, 3))]
        if node.type == "TEX_IMAGE" and not linked.is_output:
            return None, in_plane
        if node.type == "UVMAP":
            return node.uv_map or None, in_plane
        if node.type == "ATTRIBUTE":
            return node.attribute_name, in_plane
        return (None, in_plane) if node.type == "TEX_COORD" and linked.name == "UV" else None


def mapping(node: Any, notes: Notes) -> Any:
    """The 4 x 4 matrix of a Mapping node; None: it has none."""
    if node.vector_type == "NORMAL":
        return None
    sockets = [node.inputs.get(name) for name in ("Location", "Rotation", "Scale")]
    if any(socket is not None and socket.is_linked for socket in sockets):
        notes.add(f"links into the node {node.name} are not read")
    # Some kinds of it have no location.
    location, rotation, scale = (socket.default_value if socket is not None else (0.0, 0.0, 0.0) for socket in sockets)
    turn = Euler(rotation).to_matrix().to_4x4()
    shift = Matrix.Translation(location)
    if node.vector_type == "TEXTURE":
        # Blender divides by zero as if it were infinite.
        shrink = Matrix.Diagonal([*(1 / size if size else 0.0 for size in scale), 1.0])
        return np.array(shrink @ turn.transposed() @ shift.inverted())
    stretched = turn @ Matrix.Diagonal([*scale, 1.0])
    return np.array(shift @ stretched if node.vector_type == "POINT" else stretched)


# --- images -----------------------------------------------------------------------------------------------------------


def images(surface: Surface, notes: Notes) -> "tuple[dict[str, Any], Image | None]":
    """The arguments of `ec.Material` for the images, and the image whose coordinates they use."""
    base, mask = surface.image, surface.alpha_image
    used = base or mask
    options: "dict[str, Any]" = {}
    if used is None:
        return options, None
    # Beyond what is clipped, an edge of nothing goes on.
    edge = int(used.wrap == "clip")
    around = ((edge, edge), (edge, edge), (0, 0))
    if base:
        options["image"] = np.pad(encoded(base.image), around)
    if mask:
        if base and (mask.uv_map, mask.wrap) != (base.uv_map, base.wrap):
            notes.add(f"the image {mask.image.name} of its alpha has the coordinates of that of its colour")
        channels = np.pad(light(mask.image), around)
        options["alpha_image"] = to_bytes(channels[:, :, 3] if mask.alpha else luminance(channels))
    options.update(wrap="clamp_to_edge" if edge else used.wrap, filter=used.filter)
    size = np.array(used.image.size)
    within = np.diag([*(size / (size + 2 * edge)), 1.0])
    within[:2, 2] = edge / (size + 2 * edge)
    matrix = within @ used.matrix
    if not np.allclose(matrix, np.eye(3)):
        options["image_matrix"] = matrix
    return options, used


def is_readable(image: "bpy.types.Image") -> bool:
    width, height = image.size
    return 0 < min(width, height) and max(width, height) <= LONGEST_SIDE and len(image.pixels) == 4 * width * height


def stored(image: "bpy.types.Image") -> Any:
    """Height x width x 4, float32, from the top row down, as Blender has it."""
    width, height = image.size
    values = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    return np.clip(np.nan_to_num(values), 0, 1).reshape(height, width, 4)[::-1]


def is_light(image: "bpy.types.Image") -> bool:
    """Whether its numbers are light, or data, rather than sRGB. Images of fractions always are."""
    space = image.colorspace_settings
    return image.is_float or space.is_data or space.name.startswith("Linear")


def encoded(image: "bpy.types.Image") -> Any:
    """Height x width x 3, uint8, sRGB."""
    colors = stored(image)[:, :, :3]
    if is_light(image):
        colors = srgb.encoded(colors)
    return to_bytes(colors)


def light(image: "bpy.types.Image") -> Any:
    """Height x width x 4, float32, linear."""
    values = stored(image)
    if not is_light(image):
        values[:, :, :3] = srgb.light(values[:, :, :3])
    return values


def to_bytes(values: Any) -> Any:
    return np.rint(255 * values).astype(np.uint8)


def mean_color(image: "bpy.types.Image") -> "tuple[Any, ...]":
    """The mean of its linear colours and its alpha."""
    return tuple(light(image).mean(axis=(0, 1), dtype=np.float64).tolist())
