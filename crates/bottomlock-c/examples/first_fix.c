/* A vehicle at 2 m/s ahead: ten seconds of inertial readings, and pings of three beams. */
#include <bottomlock.h>
#include <stdio.h>

int main(void) {
    const double omega[3] = {0.0, 0.0, 0.0}, force[3] = {0.0, 0.0, -9.806}, sd[4] = {0.02, 0.02, 0.02, 0.02};
    const double beams[4] = {0.484, -0.484, -0.484, 0.0}; /* 2 m/s times sin 20 deg cos 45 deg, ahead or aft */
    const uint8_t valid[4] = {1, 1, 1, 0};
    bl_state state; /* surge as known at the start, to 0.3 m/s; the latitude in rad */
    bl_navigator *navigator = bl_navigator_from_json(
        "{\"geometry\": {\"preset\": \"x_janus_20\"}, \"start\": {\"velocity_p_mps\": [1.9, 0, 0]}, \"model\": {\"preset\": \"tactical\","
        " \"latitude_rad\": 0.78, \"initial\": {\"velocity_sd_mps\": [0.3, 0.3, 0.3]}}}");
    bl_status status = navigator == NULL ? bl_last_status() : BL_STATUS_OK;

    for (int step = 1; step <= 1000 && status == BL_STATUS_OK; step++) {
        const int64_t time_ns = step * INT64_C(10000000); /* 100 Hz */
        status = bl_push_imu(navigator, time_ns, omega, force);
        if (step % 100 == 0 && status == BL_STATUS_OK) status = bl_push_beams(navigator, time_ns, 4, beams, valid, sd);
    }
    if (status != BL_STATUS_OK || bl_navigator_state(navigator, &state) != BL_STATUS_OK)
        return fprintf(stderr, "%s\n", bl_last_error()), 1;
    printf("velocity %.3f %.3f %.3f m/s\n", state.velocity_p_mps[0], state.velocity_p_mps[1], state.velocity_p_mps[2]);
    bl_navigator_free(navigator);
}
