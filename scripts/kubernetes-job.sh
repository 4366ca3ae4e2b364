#!/usr/bin/env bash
# Validates the Indexed Job of `xavatar batch --emit kubernetes` against Kubernetes' published schema. Skipped where there is no
# kubernetes-validate (pip install kubernetes-validate).
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/python-module.sh kubernetes_validate
cat > "$folder/study.toml" << 'MANIFEST'
body = "body"
[[subject]]
name = "anna"
data = "data/anna"
[[subject]]
name = "ben"
data = "data/ben"
MANIFEST
cargo run --release --quiet -- batch "$folder/study.toml" --emit kubernetes > "$folder/job.yaml"
"$python" - "$folder/job.yaml" << 'SCRIPT'
import sys

import kubernetes_validate
import yaml

job = yaml.safe_load(open(sys.argv[1]))
version = kubernetes_validate.latest_version()
kubernetes_validate.validate(job, version, strict=True)
# The schema lets these be anything; a misspelt one would be found by it.
assert job["spec"]["completionMode"] == "Indexed" and job["spec"]["completions"] == 2
print(f"the Indexed Job is valid for Kubernetes {version}")
SCRIPT
