// Every call of bottomlock.hpp once: prints "as expected", or the line that was not.
#include <bottomlock.hpp>

#include <cmath>
#include <cstdio>
#include <cstring>
#ifdef __cpp_lib_span
#include <span>
#endif

namespace bl = bottomlock;

#define EXPECT(condition)                                                                                                        \
    do {                                                                                                                         \
        if (!(condition)) return std::printf("line %d: %s\n", __LINE__, #condition), 1;                                          \
    } while (0)

template <class F> static bl_status thrown(F call) {
    try {
        call();
    } catch (const bl::Error &error) {
        return std::strlen(error.what()) > 0 ? error.status : BL_STATUS_INTERNAL;
    }
    return BL_STATUS_OK;
}

int main() {
    EXPECT(thrown([] { bl::Geometry(R"({"preset": "none"})"); }) == BL_STATUS_UNKNOWN_NAME);
    const bl::Geometry geometry(R"({"configuration": "x", "tilt_rad": 0.4})");
    const bl::Geometry by_angles(R"({"tilts_rad": [0.4, 0.4, 0.4, 0.4],
        "azimuths_rad": [0.7853981633974483, 2.356194490192345, -2.356194490192345, -0.7853981633974483]})");
    EXPECT(std::abs(by_angles.direction(3)[0] - geometry.direction(3)[0]) < 1e-12);
    EXPECT(bl::Geometry(R"({"directions_d": [[0, 0, 1]]})").beams() == 1);
    EXPECT(thrown([] { bl::Geometry(R"({"directions_d": [[1, 0]]})"); }) == BL_STATUS_INVALID_VALUE);
    bl::Geometry mounted(R"({"configuration": "x", "tilt_rad": 0.4, "roll_pitch_yaw_rad": [0, 0, 0.5], "sound_speed_scale": 1.01,
        "lever_arms_p_m": [[0.1, 0.1, 0.1], [0.1, 0.1, 0.1], [0.1, 0.1, 0.1], [0.1, 0.1, 0.1]]})");
    EXPECT(mounted.direction(0) != geometry.direction(0));
    EXPECT(thrown([&] { mounted.direction(9); }) == BL_STATUS_INVALID_VALUE);
    mounted = bl::Geometry(R"({"preset": "teledyne_20"})");
    const bl::Geometry shared = mounted;
    EXPECT(mounted.beams() == 4 && shared.direction(2) == mounted.direction(2));

    bl::Model model(R"({"preset": "mti", "latitude_rad": 0.7})");
    EXPECT(thrown([] { bl::Model(); }) == BL_STATUS_INVALID_VALUE);
    model.set(R"({"initial": {"velocity_sd_mps": [0.2, 0.3, 0.4]}, "environment": {"earth": "tangent_plane"}, "depth": {"sd_m": 0.5}})");
    const bl::Model kept = model, again(model.json());
    EXPECT(kept.json() == model.json() && again.json() == model.json());
    EXPECT(kept.json().find("\"velocity_sd_mps\":[0.2,0.3,0.4]") != std::string::npos);
    model.set(R"({"depth": {"sd_m": 0.7}})");
    EXPECT(kept.json() != model.json());
    try {
        model.set(R"({"depth": {"sdm": 0.5}})");
        EXPECT(false);
    } catch (const bl::Error &error) {
        EXPECT(error.status == BL_STATUS_INVALID_VALUE && error.key == "depth.sdm");
    }
    bl::Options options(R"({"water_track": true, "gate": "off", "calibration": {"mounting_sd_rad": [0.01, 0.01, 0.01]}})");
    options.set(R"({"current_layers": {"sd_mps": 0.1}, "imu_limits": {"stuck_after": 0, "gap": "inflate"}})");
    EXPECT(bl::Options(options).json() == options.json() && bl::Options().json() != options.json());

    bl::Navigator plain(geometry, model, bl_state_at_rest(0));
    const bl::Navigator of_json(R"({"geometry": {"configuration": "x", "tilt_rad": 0.4}, "model": )" + model.json() + "}");
    EXPECT(of_json.save() == plain.save());
    bl::Navigator navigator(geometry, model, bl_state_at_rest(0), "tc", options, 1'000'000'000);
    EXPECT(plain.water() && !plain.calibration() && plain.layers().empty());
    const std::vector<double> still(4, 0.0), sd(4, 0.02);
    const std::array<std::uint8_t, 4> valid{1, 1, 1, 1};
    const bl::Vec3 zero{}, level{0.0, 0.0, -9.8}, two{2.0, 2.0, 2.0};
    for (std::int64_t step = 1; step <= 500; ++step) {
        const std::int64_t time_ns = step * 10'000'000;
        navigator.push_imu(time_ns, zero, level);
        if (step % 100 != 0) continue;
        EXPECT(navigator.push_beams(time_ns, still, valid, sd) > 0);
        EXPECT(navigator.report(0).rows == 4 && navigator.reports().size() == navigator.report_count());
        navigator.push_water_track(time_ns, still, valid, sd, 5.0);
        navigator.push_depth(time_ns, 0.0, 0.1);
        navigator.push_heading(time_ns, 0.0, 0.1);
        navigator.push_attitude(time_ns, std::array<double, 4>{1.0, 0.0, 0.0, 0.0}, 0.02, 0.1);
        navigator.push_gps(time_ns, zero, two, zero, two);
        navigator.push_velocity(time_ns, zero, std::vector<double>{0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1});
        navigator.push_gps(time_ns - 1, zero, two);
        navigator.push_acoustic_position(time_ns, zero, two);
    }
    EXPECT(thrown([&] { navigator.push_imu(1, zero, level); }) == BL_STATUS_TIME_NOT_INCREASING);
    EXPECT(thrown([&] { navigator.push_imu(1, zero, still); }) == BL_STATUS_INVALID_VALUE);
    EXPECT(thrown([&] { navigator.push_depth(INT64_C(1) << 60, 0.0, 0.1); }) == BL_STATUS_TOO_FAR_AHEAD);
    EXPECT(navigator.late_events().front() == 1);
    EXPECT(navigator.imu_faults().size() == 5);
    EXPECT(navigator.water() && navigator.calibration() && !navigator.layers().empty());
    EXPECT(navigator.push_depth(5'100'000'000, 0.0, 0.1) == 0 && navigator.discard_waiting() == 1);

    const std::vector<std::uint8_t> saved = navigator.save();
    bl::Navigator loaded = bl::Navigator::load(saved), copied = navigator, moved = std::move(copied);
    EXPECT(loaded.save() == saved && moved.save() == saved);
    EXPECT(thrown([&] { bl::Navigator::load(bl::View<std::uint8_t>(saved.data(), 60)); }) == BL_STATUS_NOT_RESTORED);
    const std::vector<std::int64_t> times{5'010'000'000, 5'020'000'000, 5'020'000'000};
    std::size_t taken = 0;
    const std::vector<double> rates(9, 0.0), forces{0.0, 0.0, -9.8, 0.0, 0.0, -9.8, 0.0, 0.0, -9.8};
    EXPECT(thrown([&] { loaded.push_imu_block(times, rates, forces, &taken); }) == BL_STATUS_TIME_NOT_INCREASING && taken == 2);
    EXPECT(loaded.state().time_ns == 5'020'000'000 && navigator.state().time_ns == 5'000'000'000);
    auto covariance = navigator.covariance();
    covariance[0] = 100.0;
    navigator.set_covariance(covariance);
    EXPECT(navigator.covariance()[0] == 100.0);
    EXPECT(thrown([&] { navigator.set_covariance(zero); }) == BL_STATUS_INVALID_VALUE);
#ifdef __cpp_lib_span
    loaded.push_imu(5'030'000'000, std::span<const double, 3>(zero), std::span<const double>(level));
#endif

    const double one[] = {0.3, 0.3, -0.3, -0.3};
    const bl_velocity velocity = bl::solve_velocity(geometry, "least_squares", one, valid, sd);
    EXPECT(velocity.fix == BL_FIX_COMPLETE && velocity.rank == 3);
    const std::uint8_t two_beams[] = {1, 1, 0, 0};
    const double prior[] = {0.5, 0.0, 0.0}, prior_cov[] = {0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1};
    EXPECT(bl::solve_velocity(geometry, "virtual_beam", one, two_beams, sd, prior, prior_cov, zero, options).fix == BL_FIX_COMPLETE);
    EXPECT(bl::solve_velocity(geometry, "virtual_beam", one, two_beams, sd).fix == BL_FIX_PRIOR_REQUIRED);
    std::puts("as expected");
    return 0;
}
