/// Registers a plugin for the scalar variants; in any other, asking for it says which ones work.
#pragma once

#include <mitsuba/core/config.h>
#include <mitsuba/core/object.h>
#include <mitsuba/core/properties.h>

NAMESPACE_BEGIN(mitsuba)

/// Calls `register_plugin` for every variant of this Mitsuba build.
template <template <typename, typename> class Plugin>
void register_scalar_plugin(std::string_view name, PluginRegisterFn register_plugin) {
    using Rgb = Plugin<float, Color<float, 3>>;
    using Spectral = Plugin<float, Spectrum<float, 4>>;
    using Polarized = Plugin<float, MuellerMatrix<Spectrum<float, 4>>>;
    const PluginInstantiateFn refuse = [](void *, const Properties &props) -> ref<Object> {
        Throw("the plugin \"%s\" works in the scalar variants only, which have no gradients: set scalar_rgb, "
              "scalar_spectral or scalar_spectral_polarized",
              props.plugin_name());
    };
    std::string_view variants = MI_VARIANTS; // one name a line
    while (!variants.empty()) {
        const std::string_view variant = variants.substr(0, variants.find('\n'));
        variants.remove_prefix(variant.size() + 1);
        PluginInstantiateFn make = refuse;
        if (variant == Rgb::Variant)
            make = [](void *, const Properties &props) -> ref<Object> { return new Rgb(props); };
        else if (variant == Spectral::Variant)
            make = [](void *, const Properties &props) -> ref<Object> { return new Spectral(props); };
        else if (variant == Polarized::Variant)
            make = [](void *, const Properties &props) -> ref<Object> { return new Polarized(props); };
        register_plugin(name, variant, Rgb::Type, make);
    }
}

NAMESPACE_END(mitsuba)

#define BSP_EXPORT_PLUGIN(Name)                                                                                        \
    extern "C" MI_EXPORT void init_plugin(std::string_view name, PluginRegisterFn register_plugin) {                   \
        register_scalar_plugin<Name>(name, register_plugin);                                                           \
    }
