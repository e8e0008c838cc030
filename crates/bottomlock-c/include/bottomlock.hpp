// bottomlock for C++17 and later: the objects of bottomlock.h with owners, views and exceptions. Header only.
//
// Frames, units and thread rules are those of bottomlock.h. A call that fails throws bottomlock::Error with its status.
// Views take arrays, std::array, std::vector, std::span of C++20 and Eigen vectors: whatever has data() and size().
#pragma once

#include "bottomlock.h"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace bottomlock {

/// A call that failed: the message of the library, its code, and the key that it is about.
struct Error : std::runtime_error {
    Error(bl_status code, const std::string &message, std::string about = {})
        : std::runtime_error(message), status(code), key(std::move(about)) {}
    bl_status status;
    std::string key;
};

namespace detail {

inline void check(bl_status status) {
    if (status != BL_STATUS_OK) throw Error(status, bl_last_error(), bl_last_error_key());
}

template <class T> T *check(T *made) {
    if (made == nullptr) throw Error(bl_last_status(), bl_last_error(), bl_last_error_key());
    return made;
}

/// An object of the library, freed once.
template <class T, void (*Free)(T *)> class Owned {
public:
    T *get() const noexcept { return owned_.get(); }

protected:
    explicit Owned(T *made) : owned_(check(made), Free) {}
    void swap(Owned &other) noexcept { owned_.swap(other.owned_); }

private:
    std::shared_ptr<T> owned_;
};

/// What `write` puts into a buffer of the size that it states.
template <class T, class Write, class Object> std::vector<T> written(Write write, const Object *object) {
    std::size_t size = 0;
    const bl_status first = write(object, nullptr, 0, &size);
    if (first != BL_STATUS_BUFFER_TOO_SMALL) check(first);
    std::vector<T> buffer(size);
    check(write(object, buffer.data(), size, &size));
    return buffer.resize(size), buffer;
}

/// Where a result goes: one value, or the numbers of an array.
template <class T> T *place(T &value) { return &value; }
template <class T, std::size_t N> T *place(std::array<T, N> &values) { return values.data(); }

/// What `call` writes behind its other arguments.
template <class T, class Call, class... A> T result(Call call, A... arguments) {
    T made{};
    return check(call(arguments..., place(made))), made;
}

/// Settings from JSON, which can be changed and written.
template <class T, T *(*FromJson)(const char *), bl_status (*Set)(T *, const char *),
          bl_status (*ToJson)(const T *, char *, std::size_t, std::size_t *), void (*Free)(T *)>
class Settings : public Owned<T, Free> {
public:
    explicit Settings(const std::string &json = "{}") : Owned<T, Free>(FromJson(json.c_str())) {}
    Settings(const Settings &other) : Settings(other.json()) {}
    Settings(Settings &&) noexcept = default;
    Settings &operator=(Settings other) noexcept { return this->swap(other), *this; }

    /// Changes what an object of JSON names; all else stays.
    Settings &set(const std::string &json) { return check(Set(this->get(), json.c_str())), *this; }
    std::string json() const {
        return written<char>(ToJson, this->get()).data();
    }
};

} // namespace detail

/// Numbers that somebody else owns.
template <class T> struct View {
    View() = default;
    View(const T *first, std::size_t count) : data(first), size(count) {}
    template <std::size_t N> View(const T (&values)[N]) : data(values), size(N) {}
    /// Whatever has data() and size(): std::array, std::vector, std::span, an Eigen vector.
    template <class C, class = std::enable_if_t<std::is_convertible_v<decltype(std::declval<const C &>().data()), const T *>>>
    View(const C &values) : data(values.data()), size(static_cast<std::size_t>(values.size())) {}

    /// The pointer of exactly `count` numbers.
    const T *of(std::size_t count, const char *what) const {
        if (size == count) return data;
        throw Error(BL_STATUS_INVALID_VALUE, std::string(what) + ": got " + std::to_string(size) + " numbers, expected " +
                                                 std::to_string(count));
    }
    /// The same, or NULL where nothing is given.
    const T *given(std::size_t count, const char *what) const { return size == 0 ? nullptr : of(count, what); }

    const T *data = nullptr;
    std::size_t size = 0;
};

using Numbers = View<double>;
/// 1 for a valid beam, 0 for a lost one.
using Flags = View<std::uint8_t>;
using Vec3 = std::array<double, 3>;
using Time = std::int64_t;
using Covariance = std::array<double, BL_STATES * BL_STATES>;

/// Directions and places of the beams of a DVL, from an object of JSON. Nothing changes them, so copies share them.
class Geometry : public detail::Owned<bl_geometry, bl_geometry_free> {
public:
    explicit Geometry(const std::string &json) : Owned(bl_geometry_from_json(json.c_str())) {}
    std::size_t beams() const { return bl_geometry_beams(get()); }
    Vec3 direction(std::size_t beam) const { return detail::result<Vec3>(bl_geometry_direction, get(), beam); }
};

/// Environment and errors of the sensors: JSON with the keys of Python's Model, or with "preset" and "latitude_rad".
using Model = detail::Settings<bl_model, bl_model_from_json, bl_model_set, bl_model_to_json, bl_model_free>;
/// Options of the filter: the defaults, with what an object of JSON names, whose keys are those of Python's Options.
using Options = detail::Settings<bl_options, bl_options_from_json, bl_options_set, bl_options_to_json, bl_options_free>;

/// An aided inertial navigator for live use. Pushes return the number of reports; `report` reads them.
class Navigator : public detail::Owned<bl_navigator, bl_navigator_free> {
public:
    /// From one object of JSON with "geometry", "model", "options", "start", "method" and "horizon_ns".
    explicit Navigator(const std::string &json) : Navigator(bl_navigator_from_json(json.c_str())) {}
    /// Without `method` it is the recommended one.
    Navigator(const Geometry &geometry, const Model &model, const bl_state &initial, const std::string &method = {},
              const Options &options = Options(), Time horizon_ns = BL_DEFAULT_HORIZON_NS)
        : Navigator(bl_navigator_new(geometry.get(), model.get(), options.get(), method.empty() ? nullptr : method.c_str(),
                                     &initial, horizon_ns)) {}
    static Navigator load(View<std::uint8_t> bytes) { return Navigator(bl_navigator_load(bytes.data, bytes.size)); }

    Navigator(const Navigator &other) : Navigator(bl_navigator_copy(other.get())) {}
    Navigator(Navigator &&) noexcept = default;
    Navigator &operator=(Navigator other) noexcept { return swap(other), *this; }

    auto push_imu(Time time_ns, Numbers omega_p_radps, Numbers force_p_mps2) {
        return pushed(bl_push_imu(get(), time_ns, omega_p_radps.of(3, "omega_p_radps"), force_p_mps2.of(3, "force_p_mps2")));
    }
    /// Times, and as many rows of three numbers each. `taken` is the number of readings before one that is refused.
    auto push_imu_block(View<Time> time_ns, Numbers omega_p_radps, Numbers force_p_mps2, std::size_t *taken = nullptr) {
        const std::size_t count = time_ns.size;
        return pushed(bl_push_imu_block(get(), count, time_ns.data, omega_p_radps.of(3 * count, "omega_p_radps"),
                                        force_p_mps2.of(3 * count, "force_p_mps2"), taken));
    }
    auto push_beams(Time time_ns, Numbers velocity_mps, Flags valid, Numbers sd_mps) {
        const std::size_t beams = velocity_mps.size;
        return pushed(bl_push_beams(get(), time_ns, beams, velocity_mps.data, valid.of(beams, "valid"),
                                    sd_mps.of(beams, "sd_mps")));
    }
    auto push_water_track(Time time_ns, Numbers velocity_mps, Flags valid, Numbers sd_mps, double range_m) {
        const std::size_t beams = velocity_mps.size;
        return pushed(bl_push_water_track(get(), time_ns, beams, velocity_mps.data, valid.of(beams, "valid"),
                                          sd_mps.of(beams, "sd_mps"), range_m));
    }
    auto push_velocity(Time time_ns, Numbers velocity_p_mps, Numbers cov_m2ps2) {
        return pushed(bl_push_velocity(get(), time_ns, velocity_p_mps.of(3, "velocity_p_mps"), cov_m2ps2.of(9, "cov_m2ps2")));
    }
    auto push_depth(Time time_ns, double depth_m, double sd_m) { return pushed(bl_push_depth(get(), time_ns, depth_m, sd_m)); }
    auto push_heading(Time time_ns, double yaw_rad, double sd_rad) {
        return pushed(bl_push_heading(get(), time_ns, yaw_rad, sd_rad));
    }
    auto push_thrust(Time time_ns, Numbers speed_p_mps, double sd_mps) {
        return pushed(bl_push_thrust(get(), time_ns, speed_p_mps.of(3, "speed_p_mps"), sd_mps));
    }
    auto push_attitude(Time time_ns, Numbers attitude_t_p, double roll_pitch_sd_rad, double yaw_sd_rad) {
        return pushed(bl_push_attitude(get(), time_ns, attitude_t_p.of(4, "attitude_t_p"), roll_pitch_sd_rad, yaw_sd_rad));
    }
    /// A position, with a velocity where the receiver has one.
    auto push_gps(Time time_ns, Numbers position_t_m, Numbers position_sd_m, Numbers velocity_t_mps = {},
                  Numbers velocity_sd_mps = {}) {
        return pushed(bl_push_gps(get(), time_ns, position_t_m.of(3, "position_t_m"), position_sd_m.of(3, "position_sd_m"),
                                  velocity_t_mps.given(3, "velocity_t_mps"), velocity_sd_mps.given(3, "velocity_sd_mps")));
    }
    /// Without `sd_m` it is the model's.
    auto push_acoustic_position(Time time_ns, Numbers position_t_m, Numbers sd_m = {}) {
        return pushed(bl_push_acoustic_position(get(), time_ns, position_t_m.of(3, "position_t_m"), sd_m.given(3, "sd_m")));
    }

    /// Reports of the last push, also of one that threw.
    std::size_t report_count() const { return bl_report_count(get()); }
    bl_report report(std::size_t number) const { return detail::result<bl_report>(bl_report_get, get(), number); }
    std::vector<bl_report> reports() const {
        std::vector<bl_report> all;
        while (all.size() < report_count()) all.push_back(report(all.size()));
        return all;
    }

    /// The covariance is row by row.
    bl_state state() const { return detail::result<bl_state>(bl_navigator_state, get()); }
    Covariance covariance() const { return detail::result<Covariance>(bl_navigator_covariance, get()); }
    void set_covariance(Numbers covariance) {
        detail::check(bl_navigator_set_covariance(get(), covariance.of(BL_STATES * BL_STATES, "covariance")));
    }

    /// Readings that came too late, in the order of bl_stream_name, and faults, in that of bl_imu_fault_name.
    std::vector<std::uint64_t> late_events() const { return detail::written<std::uint64_t>(bl_navigator_late_events, get()); }
    std::vector<std::uint64_t> imu_faults() const { return detail::written<std::uint64_t>(bl_navigator_imu_faults, get()); }
    std::size_t discard_waiting() { return detail::result<std::size_t>(bl_navigator_discard_waiting, get()); }

    /// Nothing where it is not estimated.
    std::optional<bl_water> water() const { return estimate<bl_water>(bl_navigator_water); }
    std::optional<bl_thrust> thrust() const { return estimate<bl_thrust>(bl_navigator_thrust); }
    std::optional<bl_calibration> calibration() const { return estimate<bl_calibration>(bl_navigator_calibration); }
    /// The current by depth; empty where it is not estimated.
    std::vector<bl_layer> layers() const { return detail::written<bl_layer>(bl_navigator_layers, get()); }

    /// The whole navigator as bytes, which `load` takes. Nothing may be pushed meanwhile.
    std::vector<std::uint8_t> save() const { return detail::written<std::uint8_t>(bl_navigator_save, get()); }

private:
    explicit Navigator(bl_navigator *made) : Owned(made) {}
    std::size_t pushed(bl_status status) const { return detail::check(status), report_count(); }
    template <class T> std::optional<T> estimate(bl_status (*of)(const bl_navigator *, T *)) const {
        T found{};
        const bl_status status = of(get(), &found);
        if (status == BL_STATUS_NOT_AVAILABLE) return std::nullopt;
        return detail::check(status), found;
    }
};

/// Velocity of one ping with its covariance. Without a prior, views of it are left out.
inline bl_velocity solve_velocity(const Geometry &geometry, const std::string &method, Numbers velocity_mps, Flags valid,
                                  Numbers sd_mps, Numbers prior_velocity_p_mps = {}, Numbers prior_cov_m2ps2 = {},
                                  Numbers omega_tp_p_radps = {}, const Options &options = Options()) {
    const std::size_t beams = velocity_mps.size;
    return detail::result<bl_velocity>(
        bl_solve_velocity, geometry.get(), method.c_str(), beams, velocity_mps.data, valid.of(beams, "valid"),
        sd_mps.of(beams, "sd_mps"), prior_velocity_p_mps.given(3, "prior_velocity_p_mps"),
        prior_cov_m2ps2.given(9, "prior_cov_m2ps2"), omega_tp_p_radps.given(3, "omega_tp_p_radps"), options.get());
}

} // namespace bottomlock
