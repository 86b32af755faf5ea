# SPDX-License-Identifier: BSD-3-Clause
# The schema for editors against configurations that are good, and that are not. The second line of a
# wrong one's head says whether a schema can tell: unknown frames and the like it cannot.
import glob
import json
import os
import sys

import jsonschema
import yaml

root = sys.argv[1]
here = os.path.join(root, "tests/hardware/yaml")
with open(os.path.join(root, "examples/icat_run/icat.schema.json")) as file:
    schema = json.load(file)
jsonschema.Draft7Validator.check_schema(schema)
validator = jsonschema.Draft7Validator(schema)


def errors(path):
    with open(path) as text:
        found = validator.iter_errors(yaml.safe_load(text))
    return [f"{'/'.join(map(str, e.absolute_path))}: {e.message}" for e in found]


failures = []
good = glob.glob(os.path.join(root, "examples/*/*.yaml"))
good += glob.glob(os.path.join(here, "*.yaml")) + glob.glob(os.path.join(here, "robots/*.yaml"))
for path in good:
    failures += [f"{path}: {error}" for error in errors(path)]
refused = 0
for path in glob.glob(os.path.join(here, "wrong/*.yaml")):
    with open(path) as text:
        expected = text.readline().split("schema:")[1].strip()
    if expected == "unreadable":
        continue
    found = errors(path)
    refused += bool(found)
    if bool(found) != (expected == "refuses"):
        failures.append(f"{path}: expected that the schema {expected} it: {found}")
print(f"{len(good)} good configurations, {refused} that the schema refuses")
print("\n".join(failures))
sys.exit(bool(failures) or len(good) < 6 or refused < 5)
