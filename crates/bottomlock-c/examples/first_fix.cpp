// first_fix.c in C++17, with the covariance, the reports and one ping on its own.
#include <bottomlock.hpp>

#include <cmath>
#include <cstdio>
#include <exception>

namespace bl = bottomlock;

int main() try {
    const std::array<double, 4> beams{0.484, -0.484, -0.484, 0.0}, sd{0.02, 0.02, 0.02, 0.02};
    const std::vector<std::uint8_t> valid{1, 1, 1, 0};
    const bl::Geometry geometry(R"({"preset": "x_janus_20"})");
    const bl::Model model(R"({"preset": "tactical", "latitude_rad": 0.78, "initial": {"velocity_sd_mps": [0.3, 0.3, 0.3]}})");
    auto start = bl_state_at_rest(0);
    start.velocity_p_mps[0] = 1.9;
    bl::Navigator navigator(geometry, model, start, "tc");

    int accepted = 0;
    for (int step = 1; step <= 1000; ++step) {
        const std::int64_t time_ns = step * INT64_C(10'000'000);
        navigator.push_imu(time_ns, bl::Vec3{0.0, 0.0, 0.0}, bl::Vec3{0.0, 0.0, -9.806});
        if (step % 100 != 0) continue;
        navigator.push_beams(time_ns, beams, valid, sd);
        for (const auto &report : navigator.reports()) accepted += report.verdict == BL_VERDICT_ACCEPTED;
    }
    const auto state = navigator.state();
    const auto covariance = navigator.covariance();
    std::printf("velocity %.3f %.3f %.3f m/s, surge to %.3f m/s; %d reports accepted\n", state.velocity_p_mps[0],
                state.velocity_p_mps[1], state.velocity_p_mps[2], std::sqrt(covariance[6 * BL_STATES + 6]), accepted);
    const auto ping = bl::solve_velocity(geometry, "least_squares", beams, valid, sd);
    std::printf("one ping: surge %.3f m/s to %.3f m/s\n", ping.velocity_p_mps[0], std::sqrt(ping.cov_m2ps2[0][0]));
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
