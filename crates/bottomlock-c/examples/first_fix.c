/* A vehicle at 2 m/s over the ground: ten seconds of inertial readings and pings of three beams. */
#include <bottomlock.h>
#include <stdio.h>

int main(void) {
    const double tilt_sin = 0.3420201433256687, half = 0.7071067811865476; /* 20 deg from the vertical, 45 deg from the bow */
    const double omega[3] = {0.0, 0.0, 0.0}, force[3] = {0.0, 0.0, -9.80665}, sd[4] = {0.02, 0.02, 0.02, 0.02};
    const double ahead = 2.0 * tilt_sin * half, beams[4] = {ahead, -ahead, -ahead, 0.0};
    const uint8_t valid[4] = {1, 1, 1, 0};
    bl_geometry *geometry = bl_geometry_preset("x_janus_20");
    bl_model *model = bl_model_preset("tactical", 0.78);
    bl_state state = bl_state_at_rest(0);
    bl_navigator *navigator = bl_navigator_new(geometry, model, NULL, "tc", &state, BL_DEFAULT_HORIZON_NS);
    int failed = navigator == NULL || bl_model_set(model, "dvl.beam_noise_sd_mps", 0.02) != BL_STATUS_OK;

    for (int64_t step = 1; step <= 1000 && !failed; step++) {
        const int64_t time_ns = step * 10000000; /* 100 Hz */
        failed = bl_push_imu(navigator, time_ns, omega, force) != BL_STATUS_OK;
        if (step % 100 == 0 && !failed) failed = bl_push_beams(navigator, time_ns, 4, beams, valid, sd) != BL_STATUS_OK;
    }
    if (failed || bl_navigator_state(navigator, &state) != BL_STATUS_OK) {
        fprintf(stderr, "%s\n", bl_last_error());
        return 1;
    }
    printf("velocity %.3f %.3f %.3f m/s\n", state.velocity_p_mps[0], state.velocity_p_mps[1], state.velocity_p_mps[2]);
    bl_navigator_free(navigator);
    bl_model_free(model);
    bl_geometry_free(geometry);
    return 0;
}
