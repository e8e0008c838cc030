// bottomlock for C++17 and later: the objects of bottomlock.h with owners, views and exceptions. Header only.
//
// Frames, units and thread rules are those of bottomlock.h. A call that fails throws bottomlock::Error with its status.
// Views take arrays, std::array, std::vector, std::span of C++20 and Eigen vectors: whatever has data() and size(). With
// BOTTOMLOCK_EIGEN defined, or Eigen included before, `eigen` maps results to its vectors and matrices.
#pragma once

#include "bottomlock.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#ifdef BOTTOMLOCK_EIGEN
#include <Eigen/Core>
#endif

namespace bottomlock {

/// A call that failed: the message of the library, its code, and the key that it is about.
class Error : public std::runtime_error {
public:
    Error(bl_status status, const std::string &message, std::string key = {})
        : std::runtime_error(message), status_(status), key_(std::move(key)) {}
    bl_status status() const noexcept { return status_; }
    const std::string &key() const noexcept { return key_; }

private:
    bl_status status_;
    std::string key_;
};

namespace detail {

inline void check(bl_status status) {
    if (status != BL_STATUS_OK) throw Error(status, bl_last_error(), bl_last_error_key());
}

template <class T> T *check(T *made) {
    if (made == nullptr) throw Error(bl_last_status(), bl_last_error(), bl_last_error_key());
    return made;
}

/// NULL, which stands for the default, for an empty text.
inline const char *given(const std::string &text) { return text.empty() ? nullptr : text.c_str(); }

inline void require(std::size_t got, std::size_t expected, const char *what) {
    if (got != expected) {
        throw Error(BL_STATUS_INVALID_VALUE, std::string(what) + ": got " + std::to_string(got) + " numbers, expected " +
                                                 std::to_string(expected));
    }
}

template <class T, void (*Free)(T *)> struct Deleter {
    void operator()(T *object) const noexcept { Free(object); }
};
template <class T, void (*Free)(T *)> using Owned = std::unique_ptr<T, Deleter<T, Free>>;

/// Every name of a list.
inline std::vector<std::string> names(const char *(*of)(std::size_t)) {
    std::vector<std::string> names;
    while (const char *name = of(names.size())) names.emplace_back(name);
    return names;
}

/// What `write` puts into a buffer of the size that it states.
template <class Buffer, class Write, class Object> Buffer written(Write write, const Object *object) {
    std::size_t size = 0;
    const bl_status first = write(object, nullptr, 0, &size);
    if (first != BL_STATUS_BUFFER_TOO_SMALL) check(first);
    Buffer buffer;
    buffer.resize(size);
    check(write(object, buffer.data(), size, &size));
    buffer.resize(size);
    return buffer;
}

/// Where a result goes: one value, or the numbers of an array.
template <class T> T *place(T &value) { return &value; }
template <class T, std::size_t N> T *place(std::array<T, N> &values) { return values.data(); }

/// What `call` writes behind its other arguments.
template <class T, class Call, class... A> T result(Call call, A... arguments) {
    T made{};
    check(call(arguments..., place(made)));
    return made;
}

/// Settings from JSON, which can be changed and written.
template <class T, T *(*FromJson)(const char *), bl_status (*Set)(T *, const char *),
          bl_status (*ToJson)(const T *, char *, std::size_t, std::size_t *), void (*Free)(T *)>
class Settings {
public:
    explicit Settings(const std::string &json) : owned_(check(FromJson(json.c_str()))) {}
    Settings(const Settings &other) : Settings(other.json()) {}
    Settings(Settings &&) noexcept = default;
    Settings &operator=(Settings other) noexcept {
        owned_.swap(other.owned_);
        return *this;
    }

    /// Changes what an object of JSON names; all else stays.
    Settings &set(const std::string &json) {
        check(Set(get(), json.c_str()));
        return *this;
    }
    std::string json() const {
        auto text = written<std::string>(ToJson, get());
        text.pop_back();
        return text;
    }
    T *get() const noexcept { return owned_.get(); }

private:
    Owned<T, Free> owned_;
};

} // namespace detail

/// Numbers that somebody else owns.
template <class T> class View {
public:
    View() = default;
    View(const T *data, std::size_t size) : data_(data), size_(size) {}
    template <std::size_t N> View(const T (&values)[N]) : data_(values), size_(N) {}
    /// Whatever has data() and size(): std::array, std::vector, std::span, an Eigen vector.
    template <class C,
              class = std::enable_if_t<std::is_convertible_v<decltype(std::declval<const C &>().data()), const T *> &&
                                       std::is_convertible_v<decltype(std::declval<const C &>().size()), std::size_t>>>
    View(const C &values) : data_(values.data()), size_(static_cast<std::size_t>(values.size())) {}

    const T *data() const noexcept { return data_; }
    std::size_t size() const noexcept { return size_; }

    /// The pointer of exactly `count` numbers.
    const T *of(std::size_t count, const char *what) const {
        detail::require(size_, count, what);
        return data_;
    }

private:
    const T *data_ = nullptr;
    std::size_t size_ = 0;
};

using Numbers = View<double>;
/// 1 for a valid beam, 0 for a lost one.
using Flags = View<std::uint8_t>;
using Vec3 = std::array<double, 3>;
using Quaternion = std::array<double, 4>;
using Covariance = std::array<double, BL_STATES * BL_STATES>;
using State = bl_state;
using Report = bl_report;
using Velocity = bl_velocity;
/// Numbers with their names.
using Counts = std::vector<std::pair<std::string, std::uint64_t>>;

inline std::string version() { return bl_version(); }

/// The state at rest at the origin, level, heading north.
inline State at_rest(std::int64_t time_ns) { return bl_state_at_rest(time_ns); }

inline Quaternion attitude_from_euler(double roll_rad, double pitch_rad, double yaw_rad) {
    return detail::result<Quaternion>(bl_attitude_from_euler, roll_rad, pitch_rad, yaw_rad);
}

/// Roll, pitch and yaw, rad.
inline Vec3 euler_from_attitude(Numbers attitude_t_p) {
    return detail::result<Vec3>(bl_euler_from_attitude, attitude_t_p.of(4, "attitude_t_p"));
}

/// Directions and places of the beams of a DVL, from an object of JSON. Nothing changes them, so copies share them.
class Geometry {
public:
    explicit Geometry(const std::string &json)
        : shared_(detail::check(bl_geometry_from_json(json.c_str())), bl_geometry_free) {}
    static std::vector<std::string> presets() { return detail::names(bl_geometry_preset_name); }

    std::size_t beams() const { return bl_geometry_beams(get()); }
    Vec3 direction(std::size_t beam) const { return detail::result<Vec3>(bl_geometry_direction, get(), beam); }
    const bl_geometry *get() const noexcept { return shared_.get(); }

private:
    std::shared_ptr<bl_geometry> shared_;
};

/// Environment and errors of the sensors: JSON with the keys of Python's Model, or with "preset" and "latitude_rad".
class Model : public detail::Settings<bl_model, bl_model_from_json, bl_model_set, bl_model_to_json, bl_model_free> {
public:
    using Settings::Settings;
    static std::vector<std::string> presets() { return detail::names(bl_model_preset_name); }
};

/// Options of the filter: the defaults, or those with what an object of JSON names, whose keys are those of Python's Options.
class Options
    : public detail::Settings<bl_options, bl_options_from_json, bl_options_set, bl_options_to_json, bl_options_free> {
public:
    explicit Options(const std::string &json = "{}") : Settings(json) {}
};

/// An aided inertial navigator for live use. Pushes return the number of reports; `report` reads them.
class Navigator {
public:
    /// From one object of JSON with "geometry", "model", "options", "start", "method" and "horizon_ns".
    explicit Navigator(const std::string &json) : Navigator(bl_navigator_from_json(json.c_str())) {}
    /// `options` may be left out: Navigator(geometry, model, state, "tc"). Without `method` it is the recommended one.
    Navigator(const Geometry &geometry, const Model &model, const State &initial, const std::string &method = {},
              std::int64_t horizon_ns = BL_DEFAULT_HORIZON_NS)
        : Navigator(bl_navigator_new(geometry.get(), model.get(), nullptr, detail::given(method), &initial, horizon_ns)) {}
    Navigator(const Geometry &geometry, const Model &model, const Options &options, const State &initial,
              const std::string &method = {}, std::int64_t horizon_ns = BL_DEFAULT_HORIZON_NS)
        : Navigator(bl_navigator_new(geometry.get(), model.get(), options.get(), detail::given(method), &initial, horizon_ns)) {}
    static Navigator load(View<std::uint8_t> bytes) { return Navigator(bl_navigator_load(bytes.data(), bytes.size())); }
    static std::vector<std::string> methods() { return detail::names(bl_method_name); }

    Navigator(const Navigator &other) : Navigator(bl_navigator_copy(other.get())) {}
    Navigator(Navigator &&) noexcept = default;
    Navigator &operator=(Navigator other) noexcept {
        owned_.swap(other.owned_);
        return *this;
    }

    std::size_t push_imu(std::int64_t time_ns, Numbers omega_p_radps, Numbers force_p_mps2) {
        return pushed(bl_push_imu(get(), time_ns, omega_p_radps.of(3, "omega_p_radps"), force_p_mps2.of(3, "force_p_mps2")));
    }
    /// Times, and as many rows of three numbers each. `taken` is the number of readings before one that is refused.
    std::size_t push_imu_block(View<std::int64_t> time_ns, Numbers omega_p_radps, Numbers force_p_mps2,
                               std::size_t *taken = nullptr) {
        const std::size_t count = time_ns.size();
        return pushed(bl_push_imu_block(get(), count, time_ns.data(), omega_p_radps.of(3 * count, "omega_p_radps"),
                                        force_p_mps2.of(3 * count, "force_p_mps2"), taken));
    }
    std::size_t push_beams(std::int64_t time_ns, Numbers velocity_mps, Flags valid, Numbers sd_mps) {
        const std::size_t beams = velocity_mps.size();
        return pushed(bl_push_beams(get(), time_ns, beams, velocity_mps.data(), valid.of(beams, "valid"),
                                    sd_mps.of(beams, "sd_mps")));
    }
    std::size_t push_water_track(std::int64_t time_ns, Numbers velocity_mps, Flags valid, Numbers sd_mps, double range_m) {
        const std::size_t beams = velocity_mps.size();
        return pushed(bl_push_water_track(get(), time_ns, beams, velocity_mps.data(), valid.of(beams, "valid"),
                                          sd_mps.of(beams, "sd_mps"), range_m));
    }
    std::size_t push_velocity(std::int64_t time_ns, Numbers velocity_p_mps, Numbers cov_m2ps2) {
        return pushed(bl_push_velocity(get(), time_ns, velocity_p_mps.of(3, "velocity_p_mps"), cov_m2ps2.of(9, "cov_m2ps2")));
    }
    std::size_t push_depth(std::int64_t time_ns, double depth_m, double sd_m) {
        return pushed(bl_push_depth(get(), time_ns, depth_m, sd_m));
    }
    std::size_t push_thrust(std::int64_t time_ns, double revolutions_hz, double sd_mps) {
        return pushed(bl_push_thrust(get(), time_ns, revolutions_hz, sd_mps));
    }
    std::size_t push_effort(std::int64_t time_ns, Numbers force_p_n, double sd_n) {
        return pushed(bl_push_effort(get(), time_ns, force_p_n.of(3, "force_p_n"), sd_n));
    }
    std::size_t push_attitude(std::int64_t time_ns, Numbers attitude_t_p, double roll_pitch_sd_rad, double yaw_sd_rad) {
        return pushed(bl_push_attitude(get(), time_ns, attitude_t_p.of(4, "attitude_t_p"), roll_pitch_sd_rad, yaw_sd_rad));
    }
    std::size_t push_heading(std::int64_t time_ns, double yaw_rad, double sd_rad) {
        return pushed(bl_push_heading(get(), time_ns, yaw_rad, sd_rad));
    }
    std::size_t push_gps(std::int64_t time_ns, Numbers position_t_m, Numbers position_sd_m, Numbers velocity_t_mps,
                         Numbers velocity_sd_mps) {
        return pushed(bl_push_gps(get(), time_ns, position_t_m.of(3, "position_t_m"), position_sd_m.of(3, "position_sd_m"),
                                  velocity_t_mps.of(3, "velocity_t_mps"), velocity_sd_mps.of(3, "velocity_sd_mps")));
    }
    /// A GPS position without a velocity.
    std::size_t push_position(std::int64_t time_ns, Numbers position_t_m, Numbers position_sd_m) {
        return pushed(bl_push_gps(get(), time_ns, position_t_m.of(3, "position_t_m"), position_sd_m.of(3, "position_sd_m"),
                                  nullptr, nullptr));
    }
    std::size_t push_acoustic_position(std::int64_t time_ns, Numbers position_t_m) {
        return pushed(bl_push_acoustic_position(get(), time_ns, position_t_m.of(3, "position_t_m"), nullptr));
    }
    std::size_t push_acoustic_position(std::int64_t time_ns, Numbers position_t_m, Numbers sd_m) {
        return pushed(bl_push_acoustic_position(get(), time_ns, position_t_m.of(3, "position_t_m"), sd_m.of(3, "sd_m")));
    }

    /// Reports of the last push, also of one that threw.
    std::size_t report_count() const { return bl_report_count(get()); }
    Report report(std::size_t number) const { return detail::result<Report>(bl_report_get, get(), number); }
    std::vector<Report> reports() const {
        std::vector<Report> all(report_count());
        for (std::size_t k = 0; k < all.size(); ++k) all[k] = report(k);
        return all;
    }

    State state() const { return detail::result<State>(bl_navigator_state, get()); }
    /// Row by row.
    Covariance covariance() const { return detail::result<Covariance>(bl_navigator_covariance, get()); }
    void set_covariance(Numbers covariance) {
        detail::check(bl_navigator_set_covariance(get(), covariance.of(BL_STATES * BL_STATES, "covariance")));
    }

    /// Names and numbers of readings that came too late.
    Counts late_events() const { return counts(bl_navigator_late_events, bl_stream_name); }
    Counts imu_faults() const { return counts(bl_navigator_imu_faults, bl_imu_fault_name); }
    std::size_t discard_waiting() { return detail::result<std::size_t>(bl_navigator_discard_waiting, get()); }

    /// Nothing where it is not estimated.
    std::optional<bl_water> water() const { return estimate<bl_water>(bl_navigator_water); }
    std::optional<bl_effort> effort() const { return estimate<bl_effort>(bl_navigator_effort); }
    std::optional<bl_thrust> thrust() const { return estimate<bl_thrust>(bl_navigator_thrust); }
    std::optional<bl_calibration> calibration() const { return estimate<bl_calibration>(bl_navigator_calibration); }
    /// The current by depth; empty where it is not estimated.
    std::vector<bl_layer> layers() const {
        return detail::written<std::vector<bl_layer>>(bl_navigator_layers, get());
    }

    /// The whole navigator as bytes, which `load` takes. Nothing may be pushed meanwhile.
    std::vector<std::uint8_t> save() const {
        return detail::written<std::vector<std::uint8_t>>(bl_navigator_save, get());
    }
    bl_navigator *get() const noexcept { return owned_.get(); }

private:
    explicit Navigator(bl_navigator *made) : owned_(detail::check(made)) {}
    std::size_t pushed(bl_status status) const {
        detail::check(status);
        return report_count();
    }
    template <class T> std::optional<T> estimate(bl_status (*of)(const bl_navigator *, T *)) const {
        T found{};
        const bl_status status = of(get(), &found);
        if (status == BL_STATUS_NOT_AVAILABLE) return std::nullopt;
        detail::check(status);
        return found;
    }
    Counts counts(bl_status (*of)(const bl_navigator *, std::uint64_t *, std::size_t, std::size_t *),
                  const char *(*name)(std::size_t)) const {
        const auto numbers = detail::written<std::vector<std::uint64_t>>(of, get());
        Counts named;
        for (const std::uint64_t number : numbers) named.emplace_back(name(named.size()), number);
        return named;
    }
    detail::Owned<bl_navigator, bl_navigator_free> owned_;
};

/// Velocity of one ping with its covariance. Without a prior, views of it are left out.
inline Velocity solve_velocity(const Geometry &geometry, const std::string &method, Numbers velocity_mps, Flags valid,
                               Numbers sd_mps, Numbers prior_velocity_p_mps = {}, Numbers prior_cov_m2ps2 = {},
                               Numbers omega_tp_p_radps = {}, const Options *options = nullptr) {
    const auto optional = [](Numbers values, std::size_t count, const char *what) {
        return values.size() == 0 ? nullptr : values.of(count, what);
    };
    const std::size_t beams = velocity_mps.size();
    Velocity velocity{};
    detail::check(bl_solve_velocity(geometry.get(), method.c_str(), beams, velocity_mps.data(), valid.of(beams, "valid"),
                                    sd_mps.of(beams, "sd_mps"), optional(prior_velocity_p_mps, 3, "prior_velocity_p_mps"),
                                    optional(prior_cov_m2ps2, 9, "prior_cov_m2ps2"),
                                    optional(omega_tp_p_radps, 3, "omega_tp_p_radps"),
                                    options == nullptr ? nullptr : options->get(), &velocity));
    return velocity;
}

#if defined(BOTTOMLOCK_EIGEN) || defined(EIGEN_WORLD_VERSION)
/// An array of the library as an Eigen vector, without a copy; it must outlive the map.
template <std::size_t N> Eigen::Map<const Eigen::Matrix<double, static_cast<int>(N), 1>> eigen(const double (&values)[N]) {
    return Eigen::Map<const Eigen::Matrix<double, static_cast<int>(N), 1>>(values);
}
/// A covariance as an Eigen matrix.
inline Eigen::Matrix<double, BL_STATES, BL_STATES> eigen(const Covariance &covariance) {
    return Eigen::Map<const Eigen::Matrix<double, BL_STATES, BL_STATES, Eigen::RowMajor>>(covariance.data());
}
#endif

} // namespace bottomlock
