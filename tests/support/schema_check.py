"""What a value breaks of a JSON schema: keys, types and references, no more."""


def schema_faults(schema, value, definitions, place=""):
    """Return where a value does not fit a schema: keys, types and references, no more."""
    if "$ref" in schema:
        schema = definitions[schema["$ref"].removeprefix("#/$defs/")]
    for choices in ("anyOf", "oneOf"):
        if choices in schema:
            found = [schema_faults(option, value, definitions, place) for option in schema[choices]]
            if [] not in found:
                return [f"{place}: fits no choice"]
    types = {
        "object": dict,
        "array": list,
        "string": str,
        "number": (int, float),
        "integer": int,
        "boolean": bool,
        "null": type(None),
    }
    if "type" in schema and not isinstance(value, types[schema["type"]]):
        return [f"{place}: is no {schema['type']}"]
    if isinstance(value, dict) and {"properties", "required"} & schema.keys():
        known = schema.get("properties", {})
        faults = [
            f"{place}.{key}: missing" for key in schema.get("required", []) if key not in value
        ]
        if schema.get("additionalProperties") is False:
            faults += [f"{place}.{key}: unknown" for key in value if key not in known]
        for key in value.keys() & known.keys():
            faults += schema_faults(known[key], value[key], definitions, f"{place}.{key}")
        return faults
    if isinstance(value, list) and "items" in schema:
        return [
            fault
            for k, item in enumerate(value)
            for fault in schema_faults(schema["items"], item, definitions, f"{place}.{k}")
        ]
    return []
