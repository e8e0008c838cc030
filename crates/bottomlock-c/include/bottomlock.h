/*
 * bottomlock: aided inertial navigation with whatever Doppler velocity log (DVL) beams are left.
 *
 * Made from crates/bottomlock-c by cbindgen (`make header`); do not edit. How it is used: docs/howto/c_and_cpp.md.
 * A wrapper for C++17 is bottomlock.hpp.
 *
 * Frames, units, signs. `_t` is the tangent frame north-east-down, fixed to the Earth; `_p` the platform frame forward-right-down,
 * fixed to the vehicle. SI units, radians, time in integer nanoseconds from any origin that all streams share. Attitudes are unit
 * quaternions, scalar first, that map platform vectors to the tangent frame. Matrices are row by row.
 *
 * Pointers. A `double *` argument points to as many numbers as the call says; inputs are copied, outputs belong to the caller.
 * Objects come from a call that returns a pointer and are freed by the `_free` of their kind, once; NULL is allowed there. Texts end
 * with NUL and are UTF-8; those that a call returns live as long as the library, but that of bl_last_error.
 *
 * Errors. A call returns BL_STATUS_OK (0) or the code of its error; one that makes an object returns NULL, and bl_last_status has the
 * code. bl_last_error has the message, which names the argument, its value and what was expected; both are kept for each thread. A call
 * that fails writes no output but a size or count that was asked for, and changes nothing but the count of late readings. Beams that
 * are lost and measurements that are rejected are no errors. No call ends the process or throws.
 *
 * Threads. Different objects may be used by different threads at the same time. A navigator may be used by several: a lock inside
 * takes their calls one after another, each whole; but one thread should push, since reports are those of the last push. Geometries,
 * models and options have no lock: several threads may read one, none may read it while another changes it. An object is freed when
 * no other call uses it. Nothing is global but the last error of each thread; no thread, file, clock or signal is touched.
 */


#pragma once

#include <stddef.h>
#include <stdint.h>

// How late a reading may be where `horizon_ns` is negative, ns: 2 s.
#define BL_DEFAULT_HORIZON_NS 2000000000

// Number of error states: position (tangent), misalignment (tangent), velocity (platform), accelerometer bias, gyro bias, bias
// of four beams, scale factor of the DVL.
#define BL_STATES 20

// Most rows of a measurement.
#define BL_MAX_ROWS 8

// Most beams of an instrument.
#define BL_MAX_BEAMS 8

// Letters of the reason of a rejected inertial reading, with the NUL at its end.
#define BL_MAX_REASON 160

// What a call returns: 0 for success. `bl_last_error()` says what was wrong.
typedef enum {
    // The call did what it says.
    BL_STATUS_OK = 0,
    // A pointer is NULL that must not be.
    BL_STATUS_NULL_POINTER = 1,
    // A number, a count or a text is not what the call takes.
    BL_STATUS_INVALID_VALUE = 2,
    // No method or preset has this name.
    BL_STATUS_UNKNOWN_NAME = 3,
    // A time that does not come after the one before it in its stream.
    BL_STATUS_TIME_NOT_INCREASING = 4,
    // A reading that arrived later than the horizon allows; the navigator counts it.
    BL_STATUS_TOO_LATE = 5,
    // A measurement too far ahead of the inertial readings.
    BL_STATUS_TOO_FAR_AHEAD = 6,
    // A gap between inertial readings that is longer than the limit.
    BL_STATUS_IMU_GAP = 7,
    // A covariance that is not positive definite.
    BL_STATUS_NOT_POSITIVE_DEFINITE = 8,
    // Bytes that are no saved navigator of this version.
    BL_STATUS_NOT_RESTORED = 9,
    // The buffer holds less than there is.
    BL_STATUS_BUFFER_TOO_SMALL = 10,
    // There is no such estimate or report.
    BL_STATUS_NOT_AVAILABLE = 11,
    // A fault of the library itself: please report it with the call.
    BL_STATUS_INTERNAL = 12,
} bl_status;

// What became of a measurement or of an inertial reading.
typedef enum {
    // All rows were used.
    BL_VERDICT_ACCEPTED = 0,
    // The gate rejected some rows; the others were used.
    BL_VERDICT_ACCEPTED_IN_PART = 1,
    // It was not used.
    BL_VERDICT_REJECTED = 2,
    // It had no row.
    BL_VERDICT_NO_INFORMATION = 3,
    // A yaw near the vertical; it was not used.
    BL_VERDICT_WITHHELD = 4,
} bl_verdict;

// How much of a velocity a ping determines.
typedef enum {
    // Surge, sway and heave are solved.
    BL_FIX_COMPLETE = 0,
    // Some of them are; the others are NaN.
    BL_FIX_PARTIAL = 1,
    // None of them is, though there are beams.
    BL_FIX_UNOBSERVABLE = 2,
    // No beam is valid.
    BL_FIX_NO_BEAMS = 3,
    // The method needs a prior.
    BL_FIX_PRIOR_REQUIRED = 4,
} bl_fix;

// Directions and places of the beams of a DVL, 1 to 8 beams; nothing changes them.
typedef struct bl_geometry bl_geometry;

// Environment and errors of the sensors, SI.
typedef struct bl_model bl_model;

// An aided inertial navigator for live use. It may be used from several threads: a lock inside takes their calls one after
// another, each whole. One thread should push, since reports are those of the last push.
typedef struct bl_navigator bl_navigator;

// Options of the filter, SI.
typedef struct bl_options bl_options;

// Estimate of the motion through the water, with options of "water_track" or the method sway_current.
typedef struct {
    // Current north and east at the vehicle's depth, m/s.
    double current_t_mps[2];
    // Its covariance, in which the heading's error is, (m/s)^2.
    double current_covariance[2][2];
    // Sway gain, m.
    double sway_gain_m;
    // Heave by trim, m/s.
    double trim_heave_mps;
    // Slip along sway and heave, m/s.
    double sway_slip_mps;
    // The same along heave, m/s.
    double heave_slip_mps;
    // Estimated standard deviation of the slip along sway, m/s.
    double sway_slip_sd_mps;
    // The same along heave, m/s.
    double heave_slip_sd_mps;
    // Estimated time constant of the slip along sway, s.
    double sway_slip_time_s;
    // The same along heave, s.
    double heave_slip_time_s;
    // Number of restarts of the assumptions.
    uint64_t restarts;
    // Number of alarms that widened the slip.
    uint64_t alarms;
} bl_water;

// What the vehicle's drives make of the speed through the water, with options of "thrust"; along surge, sway and heave each.
typedef struct {
    // Speed over that which the drives say; 0 for an axis that is not used.
    double scale[3];
    // Slip: speed that the drives do not say, m/s.
    double slip_mps[3];
    // Covariance of both, in this order.
    double covariance[6][6];
} bl_thrust;

// The current at one depth, with options of "current_layers.sd_mps" and "water_track".
typedef struct {
    // Depth, m.
    double depth_m;
    // Current north and east, m/s.
    double current_t_mps[2];
    // Its covariance, (m/s)^2.
    double current_covariance[2][2];
    // Time since the layer was measured last, s; infinite for one that was not.
    double age_s;
} bl_layer;

// Estimate of the mounting and clock of the DVL, with options of "calibration".
typedef struct {
    // Rotation from the stated mounting about forward, right and down, rad.
    double mounting_rad[3];
    // Time to add to the stamps, s.
    double clock_s;
    // Covariance of both, mounting first.
    double covariance[4][4];
} bl_calibration;

// A navigation state. SI units; `_t` is the tangent frame north-east-down, `_p` the platform frame forward-right-down.
typedef struct {
    // Time of validity, ns.
    int64_t time_ns;
    // Position, m.
    double position_t_m[3];
    // Attitude, platform to tangent: a unit quaternion, scalar first.
    double attitude_t_p[4];
    // Velocity over ground, m/s.
    double velocity_p_mps[3];
    // Accelerometer bias, m/s^2.
    double accel_bias_p_mps2[3];
    // Gyro bias, rad/s.
    double gyro_bias_p_radps[3];
    // Bias of each of the first four beams, m/s.
    double dvl_bias_mps[4];
    // Scale factor error of the DVL.
    double dvl_scale_factor;
} bl_state;

// Report of one measurement, or of an inertial reading that was rejected.
typedef struct {
    // Name of the sensor: "beams", "depth", "imu" and so on. It lives as long as the library.
    const char *sensor;
    // Time of validity, ns.
    int64_t time_ns;
    // What became of it.
    bl_verdict verdict;
    // 1 where it corrects an earlier report, which a late reading has changed.
    uint8_t revised;
    // 1 where the velocity was so uncertain before the update that the linear model no longer holds.
    uint8_t beyond_linear_range;
    // 1 for every row that was rejected.
    uint8_t rejected_rows[BL_MAX_ROWS];
    // Number of rows; further entries are 0.
    uint32_t rows;
    // Degrees of freedom of the NIS.
    uint32_t degrees;
    // Innovation, in the unit of each row.
    double residual[BL_MAX_ROWS];
    // Its covariance, row by row: entry (i, j) is `covariance[i][j]`.
    double covariance[BL_MAX_ROWS][BL_MAX_ROWS];
    // Normalised innovation squared.
    double nis;
    // Its threshold; infinite without one.
    double threshold;
    // Factor by which variances grew after rejections, or by the mean of what was accepted; 1 for none.
    double inflation;
    // Part of what those rejections showed that was charged to slow errors of the sensor, 0 to 1; the rest to inertial states.
    double charged_to_sensor;
    // 1 where `beam_weight` is set.
    uint8_t has_beam_weight;
    // Weight of each beam with outlier detection: 0 for a rejected beam, NaN for a lost one.
    double beam_weight[BL_MAX_BEAMS];
    // Methods that surge, sway and heave come from with the selector of the paper, by the codes of `bl_velocity`; 0 for none.
    uint8_t component_source[3];
    // Why an inertial reading was rejected; empty otherwise.
    char reason[BL_MAX_REASON];
} bl_report;

// A velocity from one ping.
typedef struct {
    // How much is solved.
    bl_fix fix;
    // Surge, sway and heave over ground, platform frame, m/s; NaN for a component that is not solved.
    double velocity_p_mps[3];
    // Covariance, (m/s)^2; NaN likewise.
    double cov_m2ps2[3][3];
    // Why a component is not solved: 0 solved, 1 no beams, 2 outside what the beams measure, 3 the assumption does not help, 4 a
    // prior is required, 5 known from the prior alone.
    uint8_t component[3];
    // Method a component comes from: 1 least_squares, 2 virtual_beam, 3 nullified_sway, 4 partial_loose, 5 virtual_heave,
    // 6 information, 7 weak_sway; 0 for none.
    uint8_t source[3];
    // Number of independent directions.
    uint8_t rank;
    // The velocity along what is observed, m/s; zero across it.
    double observed_velocity_p_mps[3];
    // Its information matrix, (s/m)^2.
    double information_s2pm2[3][3];
} bl_velocity;





#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The message of the last call that failed on this thread; empty if none has. It stays until the thread's next failure.
const char *bl_last_error(void);

// The key or argument that it is about, such as "options.water.slip_time_s"; empty where it is about none. It stays as the message.
const char *bl_last_error_key(void);

// The status of the last call that failed on this thread, for calls that return a pointer; `BL_STATUS_OK` if none has.
bl_status bl_last_status(void);

// The version of the library, such as "0.1.0".
const char *bl_version(void);

// The motion through the water after the last update; `BL_STATUS_NOT_AVAILABLE` where it is not estimated.
bl_status bl_navigator_water(const bl_navigator *navigator, bl_water *water);

// Scale and slip of the speed by the vehicle's drives after the last update; `BL_STATUS_NOT_AVAILABLE` where they are not estimated.
bl_status bl_navigator_thrust(const bl_navigator *navigator,
                              bl_thrust *drives);

// The current by depth; `count` is the number of layers, 0 where none is estimated.
bl_status bl_navigator_layers(const bl_navigator *navigator, bl_layer *layers, size_t capacity, size_t *count);

// Estimated error of the attitude reference in roll, pitch and yaw with its standard deviation, 3 numbers each, rad;
// `BL_STATUS_NOT_AVAILABLE` where the model's magnetometer has no slow errors.
bl_status bl_navigator_attitude_error(const bl_navigator *navigator, double *error_rad, double *sd_rad);

// Estimated error of the heading sensor with its standard deviation, rad; `BL_STATUS_NOT_AVAILABLE` where the model's heading has no
// slow errors.
bl_status bl_navigator_heading_error(const bl_navigator *navigator,
                                     double *error_rad,
                                     double *sd_rad);

// The mounting and clock of the DVL after the last update; `BL_STATUS_NOT_AVAILABLE` where they are not estimated.
bl_status bl_navigator_calibration(const bl_navigator *navigator, bl_calibration *calibration);

// A geometry from an object of JSON with its beams in one of four ways: "preset", a packaged name such as "waterlinked_a50"
// (`bl_geometry_preset_name` lists them); "configuration" with "tilt_rad", four beams of equal tilt from the vertical, "x" at
// azimuths 45, 135, 225, 315 deg, "+" at 0, 90, 180, 270 deg; "tilts_rad" and "azimuths_rad", from the vertical, and from the bow
// towards starboard; or "directions_d", unit vectors from the transducer, DVL frame. Further keys: "roll_pitch_yaw_rad" (z-y-x) of
// the mounting, from the DVL frame to the platform frame; "lever_arms_p_m", the place of each transducer, platform frame;
// "sound_speed_scale", the ratio of the assumed to the true speed of sound. NULL for an error.
bl_geometry *bl_geometry_from_json(const char *json);

// Name of a packaged geometry by its number from 0, NULL beyond the last.
const char *bl_geometry_preset_name(size_t number);

// Number of beams; 0 for NULL.
size_t bl_geometry_beams(const bl_geometry *geometry);

// Unit vector of a beam, counted from 0, platform frame, mounting applied: 3 numbers.
bl_status bl_geometry_direction(const bl_geometry *geometry, size_t beam, double *direction_p);

// Frees a geometry; NULL is none. Navigators made with it stay.
void bl_geometry_free(bl_geometry *geometry);

// Name of a model preset by its number from 0, NULL beyond the last.
const char *bl_model_preset_name(size_t number);

// A model from an object of JSON with the sections "environment", "imu", "initial" and those of the sensors; or with "preset" and
// "latitude_rad", and what differs from it. A preset has the errors of a packaged grade of IMUs ("tactical"; `bl_model_preset_name`
// lists them), all else from Table 2 of Tal et al. 2017, as all of "table_2" is. Set what your sensors have. NULL for an error.
bl_model *bl_model_from_json(const char *json);

// Changes what an object of JSON names; all else stays. For example "{\"dvl\": {\"beam_noise_sd_mps\": 0.02}}". An error changes
// nothing.
bl_status bl_model_set(bl_model *model,
                       const char *json);

// The model as JSON, as `bl_options_to_json`.
bl_status bl_model_to_json(const bl_model *model, char *json, size_t capacity, size_t *size);

// Frees a model; NULL is none. Navigators made with it stay.
void bl_model_free(bl_model *model);

// Name of an aiding method by its number from 0, NULL beyond the last: "ins", "lc", "tc" and so on.
const char *bl_method_name(size_t number);

// Name of a stream by its number from 0, NULL beyond the last: "imu", "dvl", "depth" and so on.
const char *bl_stream_name(size_t number);

// Name of a fault of inertial readings by its number from 0, NULL beyond the last.
const char *bl_imu_fault_name(size_t number);

// A navigator from one object of JSON: "geometry" as `bl_geometry_from_json` and "model" as `bl_model_from_json` take it; and, where they
// differ from the defaults, "options" as of `bl_options_from_json`, "start" with the fields of `bl_state`, at rest at time 0
// otherwise, "method" and "horizon_ns" as of `bl_navigator_new`. NULL for an error; `bl_last_error_key` has its key.
bl_navigator *bl_navigator_from_json(const char *json);

// A navigator at an initial state.
//
// `options` NULL are the default ones. `method` is an aiding method: ins, lc, tc, vb, nsv, plcf, vhv, elc, info, weak_sway or
// sway_current; NULL is "sway_current", for a slender vehicle unless the options say otherwise. `horizon_ns` is how late a reading
// may be behind the last good inertial reading, 0 (none) to 10 s; negative for the default of 2 s. The objects may be freed
// afterwards. NULL for an error.
bl_navigator *bl_navigator_new(const bl_geometry *geometry,
                               const bl_model *model,
                               const bl_options *options,
                               const char *method,
                               const bl_state *initial,
                               int64_t horizon_ns);

// A copy that goes its own way. NULL for an error.
bl_navigator *bl_navigator_copy(const bl_navigator *navigator);

// Frees a navigator; NULL is none. No other call with it may be under way.
void bl_navigator_free(bl_navigator *navigator);

// Replaces the covariance of every filter: 20 by 20, 400 numbers. What is older than the estimate is then too late.
bl_status bl_navigator_set_covariance(bl_navigator *navigator, const double *covariance);

// The estimate at the time of the last inertial reading.
bl_status bl_navigator_state(const bl_navigator *navigator, bl_state *state);

// Its covariance, 20 by 20, 400 numbers; the call changes nothing.
bl_status bl_navigator_covariance(const bl_navigator *navigator, double *covariance);

// Number of readings of each stream that arrived too late and were not used, in the order of `bl_stream_name`; `count` is how
// many streams there are.
bl_status bl_navigator_late_events(const bl_navigator *navigator,
                                   uint64_t *counts,
                                   size_t capacity,
                                   size_t *count);

// Number of inertial readings that were rejected by reason, and of gaps that were bridged with inflation, in the order of
// `bl_imu_fault_name`; `count` is how many there are.
bl_status bl_navigator_imu_faults(const bl_navigator *navigator,
                                  uint64_t *counts,
                                  size_t capacity,
                                  size_t *count);

// Drops the measurements that wait for the next inertial reading, where they make its push fail; `dropped` may be NULL.
bl_status bl_navigator_discard_waiting(bl_navigator *navigator, size_t *dropped);

// The whole navigator as bytes: `size` is their number; `BL_STATUS_BUFFER_TOO_SMALL` where `bytes` holds less, as with a
// capacity of 0. Between two calls of one navigator nothing may be pushed, else the size differs.
bl_status bl_navigator_save(const bl_navigator *navigator,
                            uint8_t *bytes,
                            size_t capacity,
                            size_t *size);

// The navigator of saved bytes, also of those that Python has saved; it goes on as the saved one does, bit for bit. NULL for an
// error: bytes that are damaged, cut short or saved by another version.
bl_navigator *bl_navigator_load(const uint8_t *bytes,
                                size_t size);

// Options from an object of JSON, of which every key may be left out: "{}" has the defaults, which suit a vehicle whose inertial
// readings are instantaneous. For example "{\"gate\": \"off\", \"water\": {\"slip_time_s\": 30}}". NULL for an error.
bl_options *bl_options_from_json(const char *json);

// Changes what an object of JSON names; all else stays. An error changes nothing.
bl_status bl_options_set(bl_options *options, const char *json);

// The options as JSON, numbers to the last bit: `size` is the number of bytes with the NUL; `BL_STATUS_BUFFER_TOO_SMALL` where `json`
// holds less, as with a capacity of 0.
bl_status bl_options_to_json(const bl_options *options,
                             char *json,
                             size_t capacity,
                             size_t *size);

// Frees options; NULL is none. Navigators made with them stay.
void bl_options_free(bl_options *options);

// An inertial reading: angular rate relative to inertial space and specific force in the platform frame, 3 numbers each, rad/s
// and m/s^2; at rest and level force_p_mps2 is (0, 0, -9.8).
bl_status bl_push_imu(bl_navigator *navigator,
                      int64_t time_ns,
                      const double *omega_p_radps,
                      const double *force_p_mps2);

// Many inertial readings: `count` times, and as many rows of 3 numbers each. An error refuses the reading that it names and those
// after it; `taken` is the number of those before it, and may be NULL.
bl_status bl_push_imu_block(bl_navigator *navigator,
                            size_t count,
                            const int64_t *time_ns,
                            const double *omega_p_radps,
                            const double *force_p_mps2,
                            size_t *taken);

// A ping: velocity along each beam, m/s, 1 for a valid beam and 0 for a lost one, and the standard deviations, m/s; `beams` numbers
// each. A beam reads positive when the vehicle moves along it; entries of lost beams may be NaN.
bl_status bl_push_beams(bl_navigator *navigator,
                        int64_t time_ns,
                        size_t beams,
                        const double *velocity_mps,
                        const uint8_t *valid,
                        const double *sd_mps);

// Beams that the water returned, as `bl_push_beams` and with its sign. `range_m` leads from the transducer along the beam to the
// middle of the cell, m. For options with "water_track".
bl_status bl_push_water_track(bl_navigator *navigator,
                              int64_t time_ns,
                              size_t beams,
                              const double *velocity_mps,
                              const uint8_t *valid,
                              const double *sd_mps,
                              double range_m);

// A velocity solved by the instrument: 3 numbers in the platform frame, m/s, with its covariance, 3 by 3, (m/s)^2.
bl_status bl_push_velocity(bl_navigator *navigator,
                           int64_t time_ns,
                           const double *velocity_p_mps,
                           const double *cov_m2ps2);

// A depth below the origin of the tangent frame, with its standard deviation, m.
bl_status bl_push_depth(bl_navigator *navigator, int64_t time_ns, double depth_m, double sd_m);

// Speed through the water along surge, sway and heave, 3 numbers, m/s, that the vehicle's drives say, 0 along an axis that is not
// driven, with the white noise of each, 1 sigma. For options of "thrust".
bl_status bl_push_thrust(bl_navigator *navigator,
                         int64_t time_ns,
                         const double *speed_p_mps,
                         double sd_mps);

// An attitude, 4 numbers, scalar first, with the standard deviations of its Euler angles, rad.
bl_status bl_push_attitude(bl_navigator *navigator,
                           int64_t time_ns,
                           const double *attitude_t_p,
                           double roll_pitch_sd_rad,
                           double yaw_sd_rad);

// A yaw angle alone, with its standard deviation, rad.
bl_status bl_push_heading(bl_navigator *navigator, int64_t time_ns, double yaw_rad, double sd_rad);

// A GPS position and velocity in the tangent frame with their standard deviations, 3 numbers each, m and m/s; velocity and its
// standard deviations are NULL for a position alone.
bl_status bl_push_gps(bl_navigator *navigator,
                      int64_t time_ns,
                      const double *position_t_m,
                      const double *position_sd_m,
                      const double *velocity_t_mps,
                      const double *velocity_sd_mps);

// An acoustic position fix (USBL, LBL) of the transponder in the tangent frame, 3 numbers, m, with its standard deviations, 3
// numbers; NULL for those of the model at the fix's slant range.
bl_status bl_push_acoustic_position(bl_navigator *navigator,
                                    int64_t time_ns,
                                    const double *position_t_m,
                                    const double *sd_m);

// Number of reports of the last push: of the measurements that it processed, and of those before whose reports it changed. 0 for
// an error.
size_t bl_report_count(const bl_navigator *navigator);

// A report of the last push by its number from 0; the order is that in which they were processed.
bl_status bl_report_get(const bl_navigator *navigator, size_t number, bl_report *report);

// A state at rest at the origin, level, heading north, with zero biases.
bl_state bl_state_at_rest(int64_t time_ns);

// The attitude of roll, pitch and yaw (z-y-x), rad, as a quaternion, 4 numbers, scalar first.
bl_status bl_attitude_from_euler(double roll_rad, double pitch_rad, double yaw_rad, double *attitude_t_p);

// Roll, pitch and yaw (z-y-x), 3 numbers, rad, of an attitude, 4 numbers, scalar first.
bl_status bl_euler_from_attitude(const double *attitude_t_p, double *roll_pitch_yaw_rad);

// Velocity of one ping with its covariance, without a navigator.
//
// `method`: least_squares, virtual_beam, nullified_sway, partial_loose, virtual_heave, selector, information or weak_sway. Beams as
// in `bl_push_beams`. `prior_velocity_p_mps` (3 numbers) and `prior_cov_m2ps2` (3 by 3) are those of an inertial navigator for the
// methods that use one, both NULL otherwise. `omega_tp_p_radps` (3 numbers) is the angular rate for the lever arms, NULL for none.
// `options` has the parameters of the methods, NULL for the default ones. Beams too few for a velocity are no error: `fix` says it.
bl_status bl_solve_velocity(const bl_geometry *geometry,
                            const char *method,
                            size_t beams,
                            const double *velocity_mps,
                            const uint8_t *valid,
                            const double *sd_mps,
                            const double *prior_velocity_p_mps,
                            const double *prior_cov_m2ps2,
                            const double *omega_tp_p_radps,
                            const bl_options *options,
                            bl_velocity *velocity);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus
