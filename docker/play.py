#!/usr/bin/env python3
"""Writes what `podman kube play` can run of kubernetes.yaml: play.py FOLDER PREFIX NGINX <kubernetes.yaml >pods.yaml

A Pod for each replica of a StatefulSet and one for a Deployment, of which NGINX is the image. Podman 4.3 knows neither
StatefulSets nor Services, and of volumes only claims and folders of the host: pods are found by their names, that of a
Deployment by the name of its Service; FOLDER/NAME is the secret or ConfigMap NAME, and files of the latter are written
there; empty folders are claims too. Names of claims get PREFIX. Of the probes it knows one, which runs a program.
"""

import pathlib
import sys

import yaml


def volume_source(pod, volume, folder, prefix):
    """What podman mounts for `volume` of `pod`."""
    if "persistentVolumeClaim" in volume:
        return {"persistentVolumeClaim": {"claimName": prefix + volume["persistentVolumeClaim"]["claimName"]}}
    if "emptyDir" in volume:
        return {"persistentVolumeClaim": {"claimName": f"{prefix}{pod}-{volume['name']}"}}
    name = volume["secret"]["secretName"] if "secret" in volume else volume["configMap"]["name"]
    return {"hostPath": {"path": str(folder / name), "type": "Directory"}}


def make_pod(name, spec, folder, prefix, image):
    """The Pod `name` of the template's `spec`."""
    volumes = {volume["name"]: volume_source(name, volume, folder, prefix) for volume in spec["volumes"]}
    container = dict(spec["containers"][0])
    for mount in container["volumeMounts"]:
        file = mount.pop("subPath", None)
        if file:
            volumes[mount["name"]] = {"hostPath": {"path": volumes[mount["name"]]["hostPath"]["path"] + "/" + file, "type": "File"}}
    user = {key: spec["securityContext"][key] for key in ("runAsUser", "runAsGroup")}
    container["securityContext"] = {**container["securityContext"], **user}
    container["image"] = image or container["image"]
    probes = [container.pop(probe, {}) for probe in ("startupProbe", "readinessProbe", "livenessProbe", "lifecycle")]
    if "exec" in probes[0]:
        container["livenessProbe"] = probes[0]
    for key in ("resources", "ports"):  # it would publish them on the host
        container.pop(key)
    return {
        "apiVersion": "v1", "kind": "Pod", "metadata": {"name": name},
        "spec": {
            "containers": [container],
            "volumes": [{"name": volume, **source} for volume, source in volumes.items()],
        },
    }


def main():
    folder, prefix, nginx = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    documents, pods = list(yaml.safe_load_all(sys.stdin)), []
    services = {tuple(document["spec"]["selector"].items()): document["metadata"]["name"]
                for document in documents if document["kind"] == "Service"}
    for document in documents:
        name = document["metadata"]["name"]
        if document["kind"] == "ConfigMap":
            (folder / name).mkdir(exist_ok=True)
            for file, text in document["data"].items():
                (folder / name / file).write_text(text)
        elif document["kind"] in ("StatefulSet", "Deployment"):
            replicated = document["kind"] == "StatefulSet"
            template = document["spec"]["template"]
            service = services[tuple(template["metadata"]["labels"].items())]
            names = [f"{name}-{i}" for i in range(document["spec"]["replicas"])] if replicated else [service]
            spec = template["spec"]
            pods += [make_pod(pod, spec, folder, prefix, None if replicated else nginx) for pod in names]
    yaml.safe_dump_all(pods, sys.stdout, sort_keys=False)


main()
