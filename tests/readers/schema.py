"""Checks YAML texts against a JSON schema with readers that have nothing to do with echocast, prints JSON.

usage: schema.py SCHEMA <TEXTS    texts are a JSON list

One list element per text: what the schema says against it.
"""

import json
import sys
from pathlib import Path

import jsonschema
from ruamel.yaml import YAML

schema = json.loads(Path(sys.argv[1]).read_text())
kind = jsonschema.validators.validator_for(schema, default=None)
kind.check_schema(schema)
validator = kind(schema)
texts = json.load(sys.stdin)
# YAML 1.2, in which the key `on` is a word; in YAML 1.1 it is a truth value.
yaml = YAML(typ="safe", pure=True)
json.dump([[error.message for error in validator.iter_errors(yaml.load(text))] for text in texts], sys.stdout)
