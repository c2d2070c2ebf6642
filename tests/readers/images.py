"""Reads folders of images and their annotations with readers that have nothing to do with echocast, prints JSON.

usage: images.py FOLDER...

One list element per folder, made from its images.json: for each frame the pixels of each layer, row by row, and what the
annotations say of it, after what their formats promise has been checked. Of a set with the folders coco and voc, the
names of the images of each part, after the same checks.
"""

import contextlib
import json
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

import numpy
import tifffile
from PIL import Image
from pycocotools import mask as masks
from pycocotools.coco import COCO


def plain(array, **more):
    values = [None if value != value else value for value in array.ravel().tolist()]
    return {"type": array.dtype.str.lstrip("<|"), "shape": list(array.shape), "values": values, **more}


def pixels(path):
    if path.suffix == ".tiff":
        with tifffile.TiffFile(path) as file:
            array = file.asarray()
            numpy.testing.assert_array_equal(array, numpy.asarray(Image.open(path)))
            return plain(array, text={"description": file.pages[0].description})
    if path.suffix == ".npz":
        with numpy.load(path) as file:
            return {name: plain(array) for name, array in file.items() if not name.endswith("_names")}
    image = Image.open(path)
    palette = image.getpalette() if image.mode == "P" else None
    return plain(numpy.asarray(image), mode=image.mode, text=dict(image.text), palette=palette)


def coco(path):
    """By file name, instances put together from their masks, and what is said of each."""
    with contextlib.redirect_stdout(sys.stderr):
        data = COCO(path)
    found = {}
    assert len(data.anns) == len(data.dataset["annotations"])
    for image in data.loadImgs(data.getImgIds()):
        whole = numpy.zeros((image["height"], image["width"]), numpy.uint32)
        all = data.loadAnns(data.getAnnIds(imgIds=image["id"]))
        for one in all:
            mask = data.annToMask(one)
            assert mask.sum() == one["area"] == masks.area(one["segmentation"]), one
            assert masks.toBbox(one["segmentation"]).tolist() == one["bbox"], one
            # The same text as that of COCO's own code.
            assert masks.encode(numpy.asfortranarray(mask))["counts"].decode() == one["segmentation"]["counts"]
            assert (whole[mask == 1] == 0).all(), "masks overlap"
            assert data.loadCats(one["category_id"])[0]["name"]
            whole[mask == 1] = one["instance_id"]
            del one["segmentation"]
        found[image["file_name"]] = {"instances": plain(whole), "annotations": all}
    return found


def panoptic(path, images):
    data = json.loads(path.read_text())
    names = {image["id"]: image["file_name"] for image in data["images"]}
    categories = {category["id"] for category in data["categories"]}
    found = {}
    for one in data["annotations"]:
        color = numpy.asarray(Image.open(images / one["file_name"]).convert("RGB")).astype(numpy.uint32)
        ids = color[:, :, 0] + 256 * color[:, :, 1] + 65536 * color[:, :, 2]
        known = {0}
        for segment in one["segments_info"]:
            rows, columns = numpy.nonzero(ids == segment["id"])
            assert len(rows) == segment["area"], segment
            left, top = columns.min(), rows.min()
            assert [left, top, columns.max() - left + 1, rows.max() - top + 1] == segment["bbox"], segment
            assert segment["category_id"] in categories and segment["id"] not in known
            known.add(segment["id"])
        assert set(numpy.unique(ids).tolist()) <= known
        found[names[one["image_id"]]] = {"ids": plain(ids), "segments": one["segments_info"]}
    return found


def voc(path):
    root = ElementTree.parse(path).getroot()
    number = lambda node: float(node.text)
    objects = []
    for node in root.findall("object"):
        box = {key: [number(node.find(f"{key}/{end}")) for end in ("xmin", "ymin", "xmax", "ymax")]
               for key in ("bndbox", "amodal") if node.find(key) is not None}
        flags = {key: int(node.findtext(key)) for key in ("truncated", "occluded", "difficult", "instance")}
        objects.append({"name": node.findtext("name"), **box, **flags})
    size = [int(root.findtext(f"size/{key}")) for key in ("width", "height", "depth")]
    return {"filename": root.findtext("filename"), "folder": root.findtext("folder"), "size": size, "objects": objects}


def coco_set(root):
    parts = {}
    for path in sorted((root / "annotations").glob("instances_*.json")):
        found = coco(path)
        data = json.loads(path.read_text())
        ids = [one["id"] for one in data["images"]] + [one["id"] for one in data["annotations"]]
        assert len(set(ids[: len(found)])) == len(found) == len(data["images"])
        segments = panoptic(path.with_name(path.name.replace("instances", "panoptic")), root / "panoptic")
        for image in data["images"]:
            name = image["file_name"]
            picture = Image.open(root / "images" / name)
            assert picture.mode == "RGB" and picture.size == (image["width"], image["height"])
            instances = numpy.asarray(Image.open(root / "instance" / name)).ravel().tolist()
            assert found[name]["instances"]["values"] == instances == segments[name]["ids"]["values"], name
        names = {category["id"]: category["name"] for category in data["categories"]}
        seen = sorted({names[one["category_id"]] for one in data["annotations"]})
        parts[path.stem.removeprefix("instances_")] = {
            "images": [image["file_name"] for image in data["images"]], "seen": seen, "licenses": data["licenses"],
            "samples": [image["sample"] for image in data["images"]]}
    return parts


def voc_set(root):
    parts = {}
    for path in sorted((root / "ImageSets/Main").glob("*.txt")):
        names = path.read_text().split()
        assert names == (root / "ImageSets/Segmentation" / path.name).read_text().split()
        for name in names:
            about = voc(root / "Annotations" / f"{name}.xml")
            picture = Image.open(root / "JPEGImages" / about["filename"])
            assert picture.mode == "RGB" and list(picture.size) + [3] == about["size"]
            classes, objects = (Image.open(root / kind / f"{name}.png")
                                for kind in ("SegmentationClass", "SegmentationObject"))
            assert classes.mode == objects.mode == "P"
            words = json.loads(classes.text["names"])
            classes, objects = numpy.asarray(classes), numpy.asarray(objects)
            assert objects.max() == len(about["objects"])
            for number, one in enumerate(about["objects"], 1):
                rows, columns = numpy.nonzero(objects == number)
                assert [columns.min() + 1, rows.min() + 1, columns.max() + 1, rows.max() + 1] == one["bndbox"], one
                assert {words[str(id)] for id in numpy.unique(classes[rows, columns])} == {one["name"]}
        parts[path.stem] = names
    return parts


def read(folder):
    if not (folder / "images.json").exists():
        return {"coco": coco_set(folder / "coco"), "voc": voc_set(folder / "voc")}
    about = json.loads((folder / "images.json").read_text())
    tables = {"coco": coco, "panoptic": lambda path: panoptic(path, folder)}
    tables = {name: of(folder / f"{name}.json") for name, of in tables.items() if (folder / f"{name}.json").exists()}
    for frame in about["frames"]:
        files = frame.pop("files")
        for name in [name for name in ("voc", "panoptic") if name in files]:
            path = folder / files.pop(name)
            if name == "voc":
                frame["voc"] = voc(path)
        frame["layers"] = {layer: pixels(folder / name) for layer, name in files.items()}
        frame |= {name: table[picture] for name, table in tables.items() for picture in files.values() if picture in table}
    return about


json.dump([read(pathlib.Path(folder)) for folder in sys.argv[1:]], sys.stdout, default=int)
