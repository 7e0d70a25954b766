#!/usr/bin/env python3
"""What has changed between two descriptor sets so that clients of the first break: their bytes, their JSON or their code.

Usage: breaking.py RELEASED NEW    one line a change; exit 1 if there is any

Nothing that was released may be removed, renamed, moved to another file or mean something else; additions may come. A
field or an enum value may go if its number and its name are reserved. Files whose names start with google/ or grpc/ are
other people's contracts and are looked at all the same.
"""

import sys

from google.protobuf import descriptor_pb2

KINDS = descriptor_pb2.FieldDescriptorProto


def read(path):
    with open(path, "rb") as file:
        return descriptor_pb2.FileDescriptorSet.FromString(file.read())


def breaking(released, new):
    """The changes, in words, of one FileDescriptorSet against another."""
    then, now = _Names(released), _Names(new)
    found = []
    for kind in ("file", "message", "enum", "service"):
        for name, old in getattr(then, kind).items():
            entry = getattr(now, kind).get(name)
            if entry is None:
                found.append(f"{kind} {name} is gone")
            elif kind != "file" and entry[1] != old[1]:
                found.append(f"{kind} {name} has moved from {old[1]} to {entry[1]}")
            if entry is not None:
                found += [f"{name}{change}" for change in _COMPARE[kind](old[0], entry[0])]
    return found


class _Names:
    """Everything in a set by its full name, with the file that it is in."""

    def __init__(self, files):
        self.file, self.message, self.enum, self.service = {}, {}, {}, {}
        for file in files.file:
            self.file[file.name] = (file, file.name)
            prefix = f"{file.package}." if file.package else ""
            for service in file.service:
                self.service[prefix + service.name] = (service, file.name)
            self._add(file, prefix, file.message_type, file.enum_type)

    def _add(self, file, prefix, messages, enums):
        for enum in enums:
            self.enum[prefix + enum.name] = (enum, file.name)
        for message in messages:
            self.message[prefix + message.name] = (message, file.name)
            self._add(file, f"{prefix}{message.name}.", message.nested_type, message.enum_type)


def _differences(old, new):
    return [f": {what} was {old[what] or 'not there'}, is {new[what] or 'not there'}" for what in old
            if old[what] != new[what]]


def _file(old, new):
    def facts(file):
        return {"package": file.package, "syntax": file.syntax or "proto2"}

    def options(file):
        return {field.name: str(value) for field, value in file.options.ListFields()}

    chosen, still = options(old), options(new)
    return _differences(facts(old), facts(new)) + _differences(chosen, {name: still.get(name) for name in chosen})


def _field(field, message):
    """What of a field is seen on the wire, in JSON or in generated code."""
    # An `optional` is a oneof of its own making, of no name that anybody uses.
    group = message.oneof_decl[field.oneof_index].name if field.HasField("oneof_index") else ""
    return {
        "name": field.name,
        "JSON name": field.json_name,
        "type": KINDS.Type.Name(field.type)[5:].lower() + (f" {field.type_name}" if field.type_name else ""),
        "label": KINDS.Label.Name(field.label)[6:].lower(),
        "presence": "optional" if field.proto3_optional else "",
        "oneof": "" if field.proto3_optional else group,
        # Of proto3's numbers in a row; the clients read packed ones only.
        "packing": "off" if field.options.HasField("packed") and not field.options.packed else "",
        "default": field.default_value,
    }


def _message(old, new):
    found = []
    fields = {field.number: field for field in new.field}
    reserved = _reserved_of_message(new)
    for field in old.field:
        where = f".{field.name} = {field.number}"
        if field.number in fields:
            found += [where + d for d in _differences(_field(field, old), _field(fields[field.number], new))]
        else:
            found += _unreserved(where, field.number, field.name, reserved, new.reserved_name)
    return found + _lost_reservations(_reserved_of_message(old), reserved, old, new)


def _enum(old, new):
    found = []
    names = {}
    for value in new.value:
        names.setdefault(value.number, set()).add(value.name)
    reserved = [(part.start, part.end) for part in new.reserved_range]
    for value in old.value:
        where = f".{value.name} = {value.number}"
        if value.number not in names:
            found += _unreserved(where, value.number, value.name, reserved, new.reserved_name)
        elif value.name not in names[value.number]:
            found.append(f"{where}: is now {', '.join(sorted(names[value.number]))}")
    return found + _lost_reservations([(part.start, part.end) for part in old.reserved_range], reserved, old, new)


def _service(old, new):
    def facts(method):
        def side(streaming, message):
            return f"{'stream ' if streaming else ''}{message}"

        return {"request": side(method.client_streaming, method.input_type),
                "response": side(method.server_streaming, method.output_type)}

    found = []
    methods = {method.name: method for method in new.method}
    for method in old.method:
        if method.name not in methods:
            found.append(f".{method.name} is gone")
        else:
            found += [f".{method.name}{d}" for d in _differences(facts(method), facts(methods[method.name]))]
    return found


def _reserved_of_message(message):
    return [(part.start, part.end - 1) for part in message.reserved_range]


def _unreserved(where, number, name, ranges, names):
    if not any(first <= number <= last for first, last in ranges):
        return [f"{where} is gone, and its number is not reserved"]
    return [] if name in names else [f"{where} is gone, and its name is not reserved"]


def _lost_reservations(old_ranges, new_ranges, old, new):
    """What was once used stays out of use."""
    found = [f": reserved {first} to {last} is not reserved any more" for first, last in old_ranges
             if not any(low <= first and last <= high for low, high in new_ranges)]
    return found + [f': reserved "{name}" is not reserved any more' for name in old.reserved_name
                    if name not in new.reserved_name]


_COMPARE = {"file": _file, "message": _message, "enum": _enum, "service": _service}


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    changes = breaking(read(sys.argv[1]), read(sys.argv[2]))
    for change in changes:
        print(change)
    sys.exit(1 if changes else 0)


if __name__ == "__main__":
    main()
