/// The integrator `raycost`: what the rays of another integrator cost, pixel by pixel.
/// Its child is that integrator, whose colours and variables come first. Behind them come the rays that accelerators
/// were asked about, their steps through axis-aligned and oblique nodes, leaves visited and triangle tests, per sample:
/// of the camera ray, of shadow (any-hit) rays, and of the whole path, which both are part of. Without a child there is
/// only the camera ray, and the image is black. Shapes that Embree traces itself cost nothing.
#include <mitsuba/render/integrator.h>
#include <mitsuba/render/scene.h>

#include "plugin_properties.h"
#include "ray_costs.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class RayCost final : public SamplingIntegrator<Float, Spectrum> {
public:
    MI_IMPORT_BASE(SamplingIntegrator)
    MI_IMPORT_TYPES(Scene, Sensor, Sampler, Medium)

    explicit RayCost(const Properties &props) : Base(props) {
        for (auto &prop : props.objects()) {
            Base *integrator = prop.template try_get<Base>();
            if (integrator == nullptr)
                Throw("the child \"%s\" of a raycost is no integrator that samples pixels: path, direct, volpath, "
                      "volpathmis, depth, moment, stokes and aov do, light tracers do not",
                      prop.name());
            if (m_integrator)
                Throw("a raycost takes one integrator, but \"%s\" is the second", prop.name());
            m_integrator = integrator;
        }
        if (m_integrator)
            m_names = m_integrator->aov_names();
        m_own_place = m_names.size();
        for (const char *of : {"camera", "shadow", "path"})
            for (const char *name : counter_names)
                m_names.push_back(std::string(of) + "." + name);
    }

    std::pair<Spectrum, Mask> sample(const Scene *scene, Sampler *sampler, const RayDifferential3f &ray,
                                     const Medium *medium, Float *aovs, Mask active) const override {
        const CostWatch watch;
        RayCosts &costs = CostWatch::costs();

        // A little shorter than the path's first ray: a group remembers its last answer, but not for longer rays.
        const RayCosts start = costs;
        Ray3f camera_ray = ray;
        camera_ray.maxt = dr::prev_float(camera_ray.maxt);
        const bool hit = scene->ray_intersect_preliminary(camera_ray, true, active).is_valid();
        const RayCosts begin = costs;
        const bsp::Counters camera = begin.closest - start.closest;
        m_counted.store(m_counted || camera.rays > 0, std::memory_order_relaxed);
        if (!m_integrator) {
            write(aovs, camera, {}, camera);
            return {0.f, hit};
        }
        const auto result = m_integrator->sample(scene, sampler, ray, medium, aovs, active);
        const bsp::Counters shadow = costs.any - begin.any;
        bsp::Counters path = costs.closest - begin.closest;
        write(aovs, camera, shadow, path += shadow);
        return result;
    }

    TensorXf render(Scene *scene, Sensor *sensor, UInt32 seed, uint32_t spp, bool develop, bool evaluate) override {
        m_counted = false;
        TensorXf image = Base::render(scene, sensor, seed, spp, develop, evaluate);
        if (!m_counted)
            Log(Warn, "raycost: no camera ray was counted; only shapes under a bsptree or a nativekdtree are");
        return image;
    }

    std::vector<std::string> aov_names() const override { return m_names; }

    void traverse(TraversalCallback *callback) override {
        if (m_integrator)
            callback->put("integrator", m_integrator, ParamFlags::Differentiable);
    }

    std::string to_string() const override {
        std::ostringstream oss;
        oss << "RayCost[" << std::endl
            << "  integrator = " << (m_integrator ? string::indent(m_integrator) : "none") << std::endl
            << "]";
        return oss.str();
    }

    MI_DECLARE_CLASS(RayCost)

private:
    static constexpr const char *counter_names[] = {"rays", "axis_steps", "oblique_steps", "leaves_visited",
                                                    "triangle_tests"};

    void write(Float *aovs, const bsp::Counters &camera, const bsp::Counters &shadow, const bsp::Counters &path) const {
        if (aovs == nullptr)
            return;
        aovs += m_own_place;
        for (const bsp::Counters *c : {&camera, &shadow, &path})
            for (const uint64_t count : {c->rays, c->axis_steps, c->oblique_steps, c->leaves, c->triangle_tests})
                *aovs++ = Float(count);
    }

    ref<Base> m_integrator;
    std::vector<std::string> m_names;
    size_t m_own_place;                         ///< of the first of our own variables
    mutable std::atomic<bool> m_counted{false}; ///< whether the last image has met an accelerator
};

BSP_EXPORT_PLUGIN(RayCost)

NAMESPACE_END(mitsuba)
