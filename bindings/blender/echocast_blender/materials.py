"""Materials of Blender as those of echocast: what their node trees say about the surface, read as a glTF exporter would,
and approximated where a scanner has no use for more. What is approximated is reported, once per material."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import echocast as ec
import numpy as np

#: Custom properties of materials that are keys of materials of echocast.
KEYS = (
    "reflectance",
    "scattering",
    "sound",
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
    for key, name in [*((key, key) for key in KEYS), *PAPER_KEYS.items()]:
        # The paper's add-on writes an index of 0 for what does not refract.
        if key in material and not (key == "blainder_ior" and material[key] == 0):
            keys[name] = plain(material[key])
    rgba = material.get("blainder_rgba")
    if rgba is not None and "reflectance" not in material and len(rgba) == 4:
        keys["reflectance"] = float(rgba[3])
    # A number that is called alpha, or a sound without keys, has another purpose.
    if not isinstance(keys.get("alpha", ""), str):
        del keys["alpha"]
    if not isinstance(keys.get("sound", {}), dict):
        del keys["sound"]
    part = material.get("partID")
    options, used = images(surface, notes)
    try:
        made = ec.Material(keys, blend=blend and "alpha" not in keys, **options)
    except ec.Error as error:
        notes.add(f"its custom properties are not used: {error}")
        own = {key: value for key, value in keys.items() if key not in KEYS or key in ("metallic", "ior")}
        own.update(metallic=unit(surface.metallic), ior=max(1.0, surface.ior))
        made = ec.Material(own, blend=blend, **options)
    uv_map = used.uv_map if used else None
    return Read(made, used is not None, uv_map, None if part is None else label(part), notes.sentences())


class Notes:
    """What is approximated in a material."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.said: "dict[str, None]" = {}

    def add(self, sentence: str) -> None:
        self.said[sentence] = None

    def sentences(self) -> "list[str]":
        return [f"material {self.name}: {sentence}" for sentence in self.said]


def label(value: Any) -> str:
    """A label as text: 7.0 is 7."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def plain(value: Any) -> Any:
    """The value of a custom property as plain Python."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "to_list"):
        return value.to_list()
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def unit(value: float) -> float:
    return min(1.0, max(0.0, float(value))) if math.isfinite(value) else 0.0


def clip_threshold(material: "bpy.types.Material") -> "float | None":
    """The least alpha that is seen, if the material is a cut-out. 4.2 and later have nodes for that instead."""
    clipped = getattr(material, "blend_method", "") == "CLIP"
    return material.alpha_threshold if clipped else None


# --- nodes ------------------------------------------------------------------------------------------------------------


def tree_surface(tree: "bpy.types.NodeTree", notes: Notes) -> Surface:
    output = tree.get_output_node("ALL")
    link = source(output.inputs["Surface"], ()) if output else None
    if link is None:
        notes.add("its node tree has no surface: grey")
        return Surface()
    return shader(*link, notes, 0)


def source(socket: Any, groups: "tuple[Any, ...]") -> "tuple[Any, tuple[Any, ...]] | None":
    """The socket that `socket` is linked to, past reroutes and into and out of `groups`, the group nodes around it; None:
    it is not linked."""
    for _ in range(DEEPEST):
        if not socket.is_linked or not socket.links:
            # An input of a group is what is outside linked to.
            return None
        link = socket.links[0]
        if link.is_muted:
            return None
        node, socket = link.from_node, link.from_socket
        if node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.type == "GROUP" and node.node_tree:
            outputs = [inner for inner in node.node_tree.nodes if inner.type == "GROUP_OUTPUT"]
            output = next((inner for inner in outputs if inner.is_active_output), None)
            inner = by_identifier(output.inputs, socket.identifier) if output else None
            if inner is None:
                return None
            groups, socket = (*groups, node), inner
        elif node.type == "GROUP_INPUT" and groups:
            outer = by_identifier(groups[-1].inputs, socket.identifier)
            if outer is None:
                return None
            groups, socket = groups[:-1], outer
            if not socket.is_linked:
                return socket, groups
        elif node.mute:
            passed = next((pair.from_socket for pair in node.internal_links if pair.to_socket == socket), None)
            if passed is None:
                return None
            socket = passed
        else:
            return socket, groups
    return None


def by_identifier(sockets: Any, identifier: str) -> Any:
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def socket_of(node: Any, *names: str) -> Any:
    """The first of the inputs `names` that the node has in this version of Blender, in use."""
    return next((node.inputs[name] for name in names if name in node.inputs), None)


def shader(socket: Any, groups: "tuple[Any, ...]", notes: Notes, depth: int) -> Surface:
    """What the shader that comes out of `socket` amounts to."""
    node = socket.node
    if depth > DEEPEST or socket.is_output is False:
        return Surface()
    kind = node.type

    def number_of(*names: str, default: float) -> float:
        found = socket_of(node, *names)
        return default if found is None else number(found, groups, notes, depth)

    if kind == "BSDF_PRINCIPLED":
        surface = Surface(ior=number_of("IOR", default=1.45), roughness=number_of("Roughness", default=0.5))
        surface.metallic = number_of("Metallic", default=0.0)
        surface.transmission = number_of("Transmission Weight", "Transmission", default=0.0)
        surface.color, surface.image = color(node.inputs["Base Color"], groups, notes, depth)
        surface.alpha, surface.alpha_image = alpha(node.inputs["Alpha"], groups, notes, depth)
        return surface
    if kind in ("BSDF_DIFFUSE", "BSDF_TRANSLUCENT", "SUBSURFACE_SCATTERING", "BSDF_SHEEN", "BSDF_VELVET", "BSDF_TOON", "EMISSION"):
        found, image = color(node.inputs["Color"], groups, notes, depth)
        if kind == "EMISSION":
            notes.add("light that it emits is not seen: its colour is taken as that of a diffuse surface")
        return Surface(found, image, roughness=1.0)
    if kind in ("BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC"):
        found, image = color(socket_of(node, "Color", "Base Color"), groups, notes, depth)
        return Surface(found, image, metallic=1.0, roughness=number_of("Roughness", default=0.5))
    if kind in ("BSDF_GLASS", "BSDF_REFRACTION"):
        found, image = color(node.inputs["Color"], groups, notes, depth)
        rough = number_of("Roughness", default=0.0)
        return Surface(found, image, transmission=1.0, roughness=rough, ior=number_of("IOR", default=1.45))
    if kind == "BSDF_TRANSPARENT":
        return Surface((1.0, 1.0, 1.0), alpha=0.0)
    if kind == "HOLDOUT":
        return Surface((0.0, 0.0, 0.0))
    if kind in ("MIX_SHADER", "ADD_SHADER"):
        return mixed(node, groups, notes, depth)
    notes.add(f"the node {node.name} is not read: grey")
    return Surface()


def mixed(node: Any, groups: "tuple[Any, ...]", notes: Notes, depth: int) -> Surface:
    """A mix of two shaders. With a transparent one it is the other with an alpha."""
    sockets = [socket for socket in node.inputs if socket.type == "SHADER"]
    links = [source(socket, groups) for socket in sockets[:2]]
    parts = [shader(*link, notes, depth + 1) if link else None for link in links]
    if node.type == "ADD_SHADER":
        kinds = [link[0].node.type if link else None for link in links]
        first = next((part for part, kind in zip(parts, kinds) if part and kind != "EMISSION"), parts[0] or parts[1])
        notes.add(f"of the sum at the node {node.name} one shader is used")
        return first or Surface()
    first, second = parts
    if first is None or second is None:
        return first or second or Surface()
    factor, image = alpha(node.inputs[0], groups, notes, depth)
    clear = [part.alpha == 0.0 and part.alpha_image is None for part in (first, second)]
    if clear[0] and not clear[1]:
        return replace(second, alpha=second.alpha * factor, alpha_image=second.alpha_image or image)
    if clear[1] and not clear[0] and image is None:
        return replace(first, alpha=first.alpha * (1 - factor))
    share = factor if image is None else 0.5
    notes.add(f"the mix at the node {node.name} is approximated by one surface in between")
    between = lambda a, b: a + share * (b - a)
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


def number(socket: Any, groups: "tuple[Any, ...]", notes: Notes, depth: int) -> float:
    """The value at an input: a number, or the mean of the image that is linked to it."""
    link = source(socket, groups)
    if link is None:
        return float(socket.default_value)
    found, groups = link
    if not found.is_output:
        return scalar(found)
    node = found.node
    if node.type in ("VALUE", "RGB"):
        return scalar(found)
    if node.type == "TEX_IMAGE" and node.image:
        mean = mean_color(node.image)
        if mean is not None:
            notes.add(f"the mean of the image {node.image.name} is used for {socket.name}")
            return mean[3] if found.name == "Alpha" else sum(mean[:3]) / 3
    if node.type in ("MATH", "CLAMP", "MAP_RANGE", "SEPARATE_COLOR", "SEPRGB", "VALTORGB", "INVERT") and depth < DEEPEST:
        inner = next((inner for inner in node.inputs if inner.is_linked), None)
        if inner is not None:
            notes.add(f"the node {node.name} is passed over for {socket.name}")
            return number(inner, groups, notes, depth + 1)
    notes.add(f"the node {node.name} is not read: {socket.name} is {float(socket.default_value):.3g}")
    return float(socket.default_value)


def scalar(socket: Any) -> float:
    value = socket.default_value
    return float(value) if isinstance(value, (int, float)) else sum(value[:3]) / 3


def color(socket: Any, groups: "tuple[Any, ...]", notes: Notes, depth: int) -> "tuple[tuple[float, float, float], Image | None]":
    """The colour at an input: a factor, and the image that it multiplies."""
    white = (1.0, 1.0, 1.0)
    link = source(socket, groups)
    if link is None:
        return rgb(socket.default_value), None
    found, groups = link
    if not found.is_output:
        return rgb(found.default_value), None
    node = found.node
    if node.type == "RGB":
        return rgb(found.default_value), None
    if node.type == "VALUE":
        return (found.default_value,) * 3, None
    if node.type == "TEX_IMAGE":
        return image_color(node, groups, notes)
    if node.type == "BLACKBODY" or depth >= DEEPEST:
        return white, None
    if node.type in ("MIX_RGB", "MIX"):
        first, second = [inner for inner in node.inputs if inner.enabled and inner.type == "RGBA"][:2]
        factor = next(inner for inner in node.inputs if inner.enabled and inner.type == "VALUE")
        share = unit(number(factor, groups, notes, depth + 1)) if node_blend(node) else 0.5
        (a, image_a), (b, image_b) = (color(inner, groups, notes, depth + 1) for inner in (first, second))
        kind = node_blend(node)
        if kind == "MULTIPLY" and not (image_a and image_b):
            scaled = tuple(x * (1 - share + share * y) for x, y in zip(a, b))
            return scaled, image_a or image_b
        if kind == "MIX" and not (image_a or image_b):
            return tuple(x + share * (y - x) for x, y in zip(a, b)), None
        notes.add(f"the mix of colours at the node {node.name} is approximated by the larger share")
        return (b, image_b) if share > 0.5 else (a, image_a)
    passed = {"HUE_SAT": "Color", "BRIGHTCONTRAST": "Color", "GAMMA": "Color", "CURVE_RGB": "Color", "INVERT": "Color"}
    if node.type in passed:
        notes.add(f"the node {node.name} is passed over")
        return color(node.inputs[passed[node.type]], groups, notes, depth + 1)
    notes.add(f"the node {node.name} is not read: {socket.name} is that of the socket")
    return rgb(socket.default_value), None


def node_blend(node: Any) -> str:
    return str(getattr(node, "blend_type", "MIX"))


def rgb(value: Any) -> "tuple[float, float, float]":
    return tuple(float(channel) for channel in value[:3]) if hasattr(value, "__len__") else (float(value),) * 3


def alpha(socket: Any, groups: "tuple[Any, ...]", notes: Notes, depth: int) -> "tuple[float, Image | None]":
    """The alpha at an input: a factor, and the image that it multiplies."""
    link = source(socket, groups)
    if link is None:
        return float(socket.default_value), None
    found, groups = link
    node = found.node
    if found.is_output and node.type == "TEX_IMAGE" and node.image:
        _, image = image_color(node, groups, notes)
        if image is None:
            return 1.0, None
        return 1.0, replace(image, alpha=found.name == "Alpha")
    if found.is_output and node.type == "MATH" and node.operation in ("GREATER_THAN", "LESS_THAN", "ROUND", "MULTIPLY"):
        inner = next((inner for inner in node.inputs if inner.is_linked), None)
        if inner is not None and depth < DEEPEST:
            return alpha(inner, groups, notes, depth + 1)
    return number(socket, groups, notes, depth), None


def image_color(node: Any, groups: "tuple[Any, ...]", notes: Notes) -> "tuple[tuple[float, float, float], Image | None]":
    white = (1.0, 1.0, 1.0)
    image = node.image
    if image is None:
        notes.add(f"the node {node.name} has no image: it is pink in Blender, white here")
        return white, None
    mean = lambda why: notes.add(f"the mean of the image {image.name} is used, as {why}") or (mean_color(image) or white)[:3]
    if image.source not in ("FILE", "GENERATED"):
        return mean(f"it is {image.source.lower()}"), None
    if max(image.size) > LONGEST_SIDE:
        return mean(f"it has more than {LONGEST_SIDE} pixels a side"), None
    if min(image.size) == 0 or not image.has_data and not len(image.pixels):
        notes.add(f"the image {image.name} cannot be read: white")
        return white, None
    if node.projection != "FLAT":
        return mean(f"its projection is {node.projection.lower()}"), None
    place = coordinates(node.inputs["Vector"], groups, notes)
    if place is None:
        return mean("its coordinates are not those of a UV map"), None
    uv_map, matrix = place
    wraps = {"REPEAT": "repeat", "EXTEND": "clamp_to_edge", "CLIP": "clamp_to_edge", "MIRROR": "mirrored_repeat"}
    nearest = node.interpolation == "Closest"
    return white, Image(image, uv_map, matrix, wraps.get(node.extension, "repeat"), "nearest" if nearest else "linear")


def coordinates(socket: Any, groups: "tuple[Any, ...]", notes: Notes) -> "tuple[str | None, Any] | None":
    """The UV map that is linked to a vector input, None: the one that is rendered, and the 3 x 3 matrix in between; None:
    other coordinates."""
    matrix = np.eye(3)
    for _ in range(DEEPEST):
        link = source(socket, groups)
        if link is None:
            return (None, matrix)
        found, groups = link
        if not found.is_output:
            return None
        node = found.node
        if node.type == "UVMAP":
            return (node.uv_map or None, matrix)
        if node.type == "TEX_COORD":
            return (None, matrix) if found.name == "UV" else None
        if node.type == "ATTRIBUTE":
            return (node.attribute_name, matrix)
        if node.type != "MAPPING":
            return None
        if any(node.inputs[name].is_linked for name in ("Location", "Rotation", "Scale") if name in node.inputs):
            notes.add(f"links into the node {node.name} are not read")
        matrix = matrix @ mapping(node)
        socket = node.inputs["Vector"]
    return None


def mapping(node: Any) -> Any:
    """The 3 x 3 matrix of a Mapping node, about z only."""
    value = lambda name: node.inputs[name].default_value if name in node.inputs else (0.0, 0.0, 0.0)
    x, y = value("Location")[:2]
    angle = value("Rotation")[2]
    sx, sy = value("Scale")[:2]
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    made = np.array([[1, 0, x], [0, 1, y], [0, 0, 1]]) @ turn @ np.diag([sx, sy, 1.0])
    if node.vector_type == "TEXTURE":
        return np.linalg.inv(made) if sx and sy else np.eye(3)
    if node.vector_type in ("VECTOR", "NORMAL"):
        return turn @ np.diag([sx, sy, 1.0])
    return made


# --- images -----------------------------------------------------------------------------------------------------------


def images(surface: Surface, notes: Notes) -> "tuple[dict[str, Any], Image | None]":
    """The arguments of `ec.Material` for the images, and the image whose coordinates they use."""
    base, mask = surface.image, surface.alpha_image
    used = base or mask
    options: "dict[str, Any]" = {}
    if used is None:
        return options, None
    if base:
        options["image"] = pixels(base.image)[:, :, :3].copy()
    if mask:
        if base and (mask.uv_map, mask.wrap) != (base.uv_map, base.wrap):
            notes.add(f"the image {mask.image.name} of its alpha has the coordinates of that of its colour")
        channels = pixels(mask.image)
        options["alpha_image"] = channels[:, :, 3].copy() if mask.alpha else luminance(channels)
    options.update(wrap=used.wrap, filter=used.filter)
    if used.matrix is not None and not np.allclose(used.matrix, np.eye(3)):
        options["image_matrix"] = used.matrix
    return options, used


def pixels(image: "bpy.types.Image") -> Any:
    """Height x width x 4, uint8, sRGB, from the top row down."""
    width, height = image.size
    values = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, 4)[::-1]
    if image.is_float:
        # Images of whole numbers are stored as encoded, those of fractions as light.
        light = np.clip(values[:, :, :3], 0, 1)
        encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        values = np.concatenate([encoded, values[:, :, 3:]], axis=2)
    return np.rint(np.clip(np.nan_to_num(values), 0, 1) * 255).astype(np.uint8)


def luminance(channels: Any) -> Any:
    """Rec. ITU-R BT.709, of the encoded values, as masks are not light."""
    return np.rint(channels[:, :, :3] @ np.array([0.2126, 0.7152, 0.0722])).astype(np.uint8)


def mean_color(image: "bpy.types.Image") -> "tuple[float, float, float, float] | None":
    """The mean of its linear colours and its alpha; None if it cannot be read."""
    if min(image.size) == 0 or max(image.size) > LONGEST_SIDE or not len(image.pixels):
        return None
    encoded = pixels(image).reshape(-1, 4) / 255.0
    light = np.where(encoded[:, :3] <= 0.04045, encoded[:, :3] / 12.92, ((encoded[:, :3] + 0.055) / 1.055) ** 2.4)
    red, green, blue = light.mean(axis=0)
    return float(red), float(green), float(blue), float(encoded[:, 3].mean())
