/// Reading a plugin's properties; every mistake is one sentence that names it and the valid choices.
#pragma once

#include <mitsuba/core/logger.h>
#include <mitsuba/core/properties.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

NAMESPACE_BEGIN(mitsuba)

/// Throws unless every property that is no child has one of these names. `what` is the plugin, as messages call it.
inline void check_names(const Properties &props, const std::string &what, const std::vector<std::string> &names) {
    for (auto &prop : props) {
        if (prop.type() == Properties::Type::Object)
            continue;
        if (std::find(names.begin(), names.end(), prop.name()) != names.end())
            continue;
        std::string list;
        for (const std::string &name : names)
            list += (list.empty() ? "" : ", ") + name;
        Throw("%s has no property \"%s\": its properties are %s", what, prop.name(), list);
    }
}

/// A truth value.
inline bool read_flag(const Properties &props, const std::string &name, bool default_value) {
    if (!props.has_property(name))
        return default_value;
    if (props.type(name) != Properties::Type::Bool)
        Throw("the property \"%s\" of a %s is a boolean: true or false", name, props.plugin_name());
    return props.get<bool>(name);
}

/// The path of a folder, or an empty string.
inline std::string read_folder(const Properties &props, const std::string &name) {
    if (!props.has_property(name))
        return "";
    if (props.type(name) != Properties::Type::String)
        Throw("the property \"%s\" of a %s is a text: the path of a folder", name, props.plugin_name());
    return props.get<std::string>(name);
}

/// Any simple value as the text of a spec, numbers with all their digits.
inline std::string read_text(const Properties &props, const std::string &name) {
    props.mark_queried(name);
    switch (props.type(name)) {
    case Properties::Type::String:
        return props.get<std::string>(name);
    case Properties::Type::Bool:
    case Properties::Type::Integer:
        return props.as_string(name);
    case Properties::Type::Float: {
        char text[32];
        std::snprintf(text, sizeof text, "%.17g", props.get<double>(name));
        return text;
    }
    default:
        Throw("the property \"%s\" of a %s is a text, a number or a boolean", name, props.plugin_name());
    }
}

NAMESPACE_END(mitsuba)
