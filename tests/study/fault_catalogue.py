"""The catalogue of faults: what has to hold, and what shows it. One row a fault, and no other list.

What shows a fault is a test, as pytest names it, or a kind of fault that the study draws.
"""

from __future__ import annotations

from dataclasses import dataclass

from fault_kinds import KINDS

RULE = "study: "
"""Before a kind that the study draws."""
RECORDER, SERVICE, REST, CLIENT = (
    "tests/service/recorder/", "tests/service/", "tests/service/rest/test_rest_", "tests/client/test_",
)  # fmt: skip


@dataclass(frozen=True)
class CatalogueFault:
    number: int
    fault: str
    bar: str
    """What has to hold, with its figures."""
    shown_by: tuple[str, ...] = ()
    short: str = ""
    """What of the bar nothing shows; "" where all of it is shown."""

    @property
    def result(self) -> str:
        if not self.shown_by:
            return "not tried"
        return f"shown in part; not tried: {self.short}" if self.short else "shown"


def _drawn(*kinds: str) -> tuple[str, ...]:
    return tuple(RULE + kind for kind in kinds)


CATALOGUE = (
    CatalogueFault(
        1, "glove unplugged in mid-stream",
        "seen within 0.5 s, frames within 2 s of the replug, 100 of 100, 0 wrong frames",
        (
            CLIENT + "glove_devices.py::test_a_hundred_pulled_cables",
            CLIENT + "capture_daemon.py::test_device_unplugged_and_plugged_in_again",
            *_drawn("glove unplugged"),
        ),
        "the other glove's gap of 50 ms at most",
    ),
    CatalogueFault(
        2, "random, lost and repeated bytes from the glove",
        "10 MB of noise: 0 exceptions, the next good frame is found, 0 false frames with a checksum",
        (
            CLIENT + "cyberglove_record.py::test_ten_megabytes_of_noise_give_no_frames",
            CLIENT + "cyberglove_record.py::test_after_any_garbage_no_sound_record_is_missed",
            CLIENT + "glove_logs.py::test_wild_bytes_raise_nothing_and_the_next_good_record_is_found",
            CLIENT + "glove_devices.py::test_noise_and_short_records_bring_no_wrong_reading",
        ),
    ),
    CatalogueFault(
        3, "wrong baud rate, another device on the port",
        "a verdict within 10 s that names the cause; nothing is published",
        (
            CLIENT + "cyberglove_verdict.py::test_a_wrong_fixed_baud_rate",
            CLIENT + "cyberglove_verdict.py::test_another_device_on_the_port_of_a_glove_counts_as_lost",
            CLIENT + "glove_devices.py::test_another_glove_on_the_port_is_told",
        ),
    ),
    CatalogueFault(
        4, "sensor dead, stuck, not a number",
        "seen within 1 s of motion, its rotations marked, 0 NaN; misses at most 1 %, 1 false alarm an hour",
        (
            SERVICE + "test_realtime_faulty_sensor.py::test_the_last_good_angle_is_kept_flagged_and_counted",
            SERVICE + "test_realtime_living_sensors.py::test_live_poses_come_without_the_dead_sensor",
            SERVICE + "test_realtime_service.py::test_bad_frames_are_counted_by_reason_and_reach_no_model",
        ),
        "rates of misses and false alarms over hours of motion",
    ),
    CatalogueFault(
        5, "two gloves of one name",
        "the second is refused within 1 s and both are named; 0 mixed frames",
        (
            CLIENT + "capture_daemon.py::test_second_publisher_of_a_glove_is_refused_by_name",
            CLIENT + "capture_daemon.py"
            "::test_of_two_captures_that_met_only_when_the_router_came_one_gives_way",
            SERVICE + "test_realtime_sequence_order.py"
            "::test_of_two_publishers_on_one_key_one_is_heard_and_the_other_counted",
            *_drawn("second publisher"),
        ),
    ),
    CatalogueFault(
        6, "left and right swapped, or another person's model", "a warning within 10 s in 95 %",
        (SERVICE + "test_realtime_service.py::test_a_glove_of_the_other_hand_is_told_with_its_first_frames",),
        "another person of the same hand",
    ),
    CatalogueFault(
        7, "clock set by an hour, drift, suspend",
        "0 stamps that run backwards; clocks within 5 ms afterwards",
        (
            CLIENT + "own_clock.py::test_a_clock_that_is_set_begins_a_new_line",
            CLIENT + "glove_devices.py::test_a_glove_clock_that_is_off_and_drifts_gives_times_of_now",
            SERVICE + "test_realtime_frame_gate.py::test_time_running_backwards_costs_one_frame",
            *_drawn("clock set", "stopped, then going on"),
        ),
        "a computer that is suspended",
    ),
    CatalogueFault(
        8, "zenoh router restarted", "poses within 3 s of its return; sent = recorded + missing",
        (
            CLIENT + "capture_daemon.py"
            "::test_router_restart_costs_no_recorded_frame_and_everything_works_again",
            RECORDER + "test_recorder_takes.py::test_frames_missed_while_the_router_was_away_are_repaired",
            SERVICE + "test_serve_processes.py::test_poses_are_back_after_each_of_five_crashes",
            *_drawn("router restarted", "kill -9"),
        ),
    ),
    CatalogueFault(
        9, "network cut for 1 to 60 s",
        "recording loses 0 frames; poses within 3 s of its return; nothing old is shown as live",
        (
            CLIENT + "capture_daemon.py::test_recording_starts_without_a_router_and_publishing_when_it_comes",
            SERVICE + "test_realtime_service.py::test_a_silent_glove_is_marked_stale_about_once_a_second",
            SERVICE + "site/test_site_of_computers.py"
            "::test_a_site_is_set_up_by_its_page_and_survives_a_cut",
            *_drawn("link cut", "link standing still"),
        ),
        "cuts longer than 9 s",
    ),
    CatalogueFault(
        10, "subscriber slow or stopped",
        "only it loses: 0 frames of others, their 99th percentile 2 ms later at most, 64 MB in 10 min",
        (CLIENT + "pose_subscriber.py"
        "::test_slow_and_failing_callback_gets_the_newest_pose_and_blocks_nobody",),
        "memory of the publisher over ten minutes, a subscriber that is stopped",
    ),
    CatalogueFault(
        11, "kill -9 during training",
        "only fits in flight are repeated, each is done once; 200 kills, 0 acknowledged writes lost",
        (
            SERVICE + "test_store_killed.py::test_a_killed_service_repeats_only_the_fits_in_flight",
            SERVICE + "test_store_killed.py::test_no_acknowledged_write_is_lost",
        ),
        "200 kills of a training; of writers `python3 do.py test -m slow tests/service/test_store_killed.py` "
        "has 200 for each database, the suite 5",
    ),
    CatalogueFault(
        12, "kill -9 during an activation", "the old model or the new, never neither; 200 kills",
        (SERVICE + "test_store_killed.py::test_no_acknowledged_write_is_lost",),
        "a kill at every step of an activation: they come at random moments",
    ),
    CatalogueFault(
        13, "kill -9 during an upload or a recording",
        "0 halves of a file, at most 1 s lost, what was left over is swept",
        (
            SERVICE + "test_store_killed.py::test_no_half_of_a_file_is_imported",
            SERVICE + "test_store_artifacts.py::test_leftovers_of_killed_writers_are_swept",
            RECORDER + "test_recorder_killed.py::test_stopped_while_the_recorder_is_away",
            CLIENT + "capture_process.py"
            "::test_killed_daemon_loses_nothing_published_and_its_run_can_be_fetched_after_the_restart",
            *_drawn("kill -9", "capture away"),
        ),
    ),
    CatalogueFault(
        14, "disk full", "507, poses lose 0 frames, works within 5 s of room, the database is sound",
        (
            SERVICE + "test_store_damaged.py::test_a_full_disk_is_said_and_survived",
            RECORDER + "test_recorder_takes.py::test_a_full_disk_is_said_and_what_was_recorded_stays",
            CLIENT + "capture_process.py"
            "::test_full_disk_is_told_and_publishing_goes_on_and_the_recording_catches_up",
            REST + "take_import.py::test_a_full_disk_while_uploading",
            *_drawn("disk full"),
        ),
    ),
    CatalogueFault(
        15, "artifact damaged",
        "every flipped byte and truncation refused at load; the last good stays active",
        (
            SERVICE + "test_store_artifacts.py"
            "::test_every_flipped_bit_and_every_truncation_is_refused_by_name",
            SERVICE + "test_realtime_service.py"
            "::test_a_damaged_artifact_is_named_and_the_model_before_it_stays",
        ),
    ),
    CatalogueFault(
        16, "database damaged",
        "every changed row found by the search for damage, and when it is used; a row that an index no "
        "longer finds too; the restore is told, and takes 1 min",
        (
            SERVICE + "test_store_row_damage.py"
            "::test_a_change_of_any_column_is_noticed_and_names_table_and_row",
            SERVICE + "test_store_damaged.py::test_no_overwritten_bytes_make_another_model_active",
            SERVICE + "test_store_damages.py"
            "::test_a_changed_row_of_any_table_is_found_once_and_forgotten_when_it_is_as_before",
            SERVICE + "test_store_damages.py::test_a_row_that_an_index_does_not_find_is_told",
        ),
        "how long a restore takes",
    ),
    CatalogueFault(
        17, "PostgreSQL or the object store killed, hanging or full",
        "503 or 507 within 5 s, 0 acknowledged writes lost, poses lose 0 frames, writing within 5 s of its "
        "return",
        (
            SERVICE + "test_store_postgres.py::test_nothing_acknowledged_is_lost_when_the_server_is_killed",
            SERVICE + "rest/test_rest_store_away.py::test_a_route_of_each_kind_while_a_store_hangs",
            SERVICE + "rest/test_rest_store_away.py::test_every_route_while_the_object_store_is",
            SERVICE + "rest/test_rest_store_away.py::test_every_route_while_the_database_is",
        ),
        "how soon it writes again",
    ),
    CatalogueFault(
        18, "worker killed, hanging, out of memory", "repeated; three crashes fail with a reason",
        (
            SERVICE + "test_jobs_dispatcher.py::test_a_killed_worker_is_replaced_and_its_fit_repeated",
            SERVICE + "test_jobs_dispatcher.py::test_a_fit_that_kills_every_worker_fails_with_a_reason",
            SERVICE + "test_jobs_dispatcher.py::test_processes_that_never_come_back_are_replaced",
            SERVICE + "site/test_remote_workers.py"
            "::test_a_worker_killed_in_the_middle_is_replaced_and_its_fit_repeated",
        ),
        "a worker out of memory",
    ),
    CatalogueFault(
        19, "scheduler lost", "jobs go on within 30 s, 0 lost",
        (SERVICE + "test_jobs_dispatcher.py::test_the_scheduler_can_be_lost_in_the_middle_of_a_job",),
        "how soon",
    ),
    CatalogueFault(
        20, "malformed messages",
        "counted and dropped; 10^6 inputs, 0 crashes; 99th percentile 1 ms later at 10,000 bad a second",
        (
            CLIENT + "wire_frame.py::test_every_flipped_bit_is_refused",
            CLIENT + "wire_frame.py::test_arbitrary_bytes_are_refused_with_a_sentence",
            SERVICE + "test_realtime_frame_gate.py::test_a_flipped_byte_never_passes",
            SERVICE + "test_rate_limit.py::test_a_flood_in_a_gloves_name_does_not_cost_it_a_frame",
            *_drawn("damaged messages", "link that changes bytes"),
        ),
        "10^6 inputs of a fuzzer, 10,000 bad messages a second",
    ),
    CatalogueFault(
        21, "hostile requests", "0 answers of 5xx, 0 undocumented",
        (
            REST + "wild_bodies.py::test_whatever_is_sent",
            REST + "hostile_json.py::test_every_number_and_name_refuses",
            REST + "owasp.py::test_api8_answers_tell_nothing_of_the_inside",
        ),
    ),
    CatalogueFault(
        22, "bodies that are too large, slow or endless",
        "413 or 408; 32 MB for 1 GB; 500 slow connections keep nobody out",
        (
            REST + "bodies.py::test_a_gigabyte_is_refused_without_memory",
            REST + "bodies.py::test_slow_bodies_and_headers_are_ended",
            REST + "bodies.py::test_many_slow_connections_do_not_keep_others_out",
        ),
        "more than 200 slow connections",
    ),
    CatalogueFault(
        23, "bombs, lying headers, pickles", "refused before memory is taken; 0 unpickled",
        (
            REST + "take_import.py::test_a_parquet_bomb_is_refused_by_its_cells",
            REST + "wild_bodies.py::test_archives_that_cannot_be_read",
            REST + "bodies.py::test_lying_lengths",
            "tests/models/camera_reference/test_camera_estimates.py"
            "::test_other_files_are_refused_and_nothing_is_unpickled",
        ),
    ),
    CatalogueFault(
        24, "names that lead elsewhere", "404 or 422; 0 paths outside the data folder",
        (
            REST + "hostile_names.py::test_no_route_takes_the_name",
            REST + "owasp.py::test_nothing_outside_the_data_folder_is_opened",
        ),
    ),
    CatalogueFault(
        25, "numbers that are none, or absurd", "0 models with NaN; time and memory bounded before the start",
        (
            REST + "hostile_json.py::test_predict_refuses",
            REST + "model_import.py::test_absurd_numbers_are_refused",
            "tests/models/calibration/test_servable.py"
            "::test_a_model_whose_angles_no_pose_can_hold_is_not_kept",
        ),
        "10^7 rows",
    ),
    CatalogueFault(
        26, "poses of somebody who may not", "0 of 10,000 delivered to others",
        (
            SERVICE + "site/test_site_wire.py::test_forged_poses_frames_metas_and_statuses_reach_nobody",
            SERVICE + "site/test_site_wire.py::test_a_stranger_with_an_authority_of_its_own_does_not_get_in",
        ),
    ),
    CatalogueFault(
        27, "frames replayed or out of order", "0 accepted of 10,000",
        (
            SERVICE + "test_realtime_frame_gate.py::test_a_sequence_number_passes_once_and_only_forwards",
            SERVICE + "test_realtime_sequence_order.py"
            "::test_an_echo_never_takes_over_while_the_glove_is_there",
            RECORDER + "test_recorder_forged.py::test_what_a_stranger_publishes_stays_out_of_the_take",
            *_drawn("replayed messages"),
        ),
        "10,000 replays in one run",
    ),
    CatalogueFault(
        28, "what is another subject's", "404 on every route and key, 0 wrong cells",
        (
            REST + "access.py::test_every_route_and_role_is_as_the_table_says",
            REST + "access.py::test_what_is_another_subjects_answers_like_what_is_missing",
            SERVICE + "site/test_site_wire.py"
            "::test_every_plane_kind_and_action_is_let_through_exactly_as_the_table_says",
        ),
        "the time that an answer takes",
    ),
    CatalogueFault(
        29, "key revoked", "REST with the next request, a stream within 5 s",
        (
            REST + "access.py::test_a_revoked_key_opens_nothing_from_the_next_request_on",
            SERVICE + "site/test_site_wire.py"
            "::test_the_stream_of_a_revoked_member_stops_and_the_others_go_on",
        ),
    ),
    CatalogueFault(
        30, "log of changes tampered with", "every edit, deletion and swap found",
        (SERVICE + "test_audit_tampered.py::test_every_edit_deletion_and_swap_is_found",),
    ),
    CatalogueFault(
        31, "an older or newer version, a migration that fails", "refused, or as it was before",
        (
            SERVICE + "test_migrations.py::test_a_newer_schema_is_refused_with_a_sentence",
            SERVICE + "test_migrations.py::test_an_upgrade_that_fails_leaves_everything_as_it_was",
            SERVICE + "test_migrations.py::test_an_upgrade_keeps_the_rows_and_a_backup",
        ),
    ),
    CatalogueFault(
        32, "all at once", "500 faults a night, every frame and every acknowledged write accounted for",
        ("tests/study/test_fault_study.py::test_thirty_faults_lose_nothing", *_drawn(*KINDS)),
        "what is open is told above",
    ),
)  # fmt: skip


def catalogue_table() -> str:
    """As Markdown."""
    lines = ["| | fault | what has to hold | shown by | result |", "|---|---|---|---|---|"]
    for row in CATALOGUE:
        tests = sorted({f"`{place.partition('::')[0]}`" for place in row.shown_by if "::" in place})
        kinds = [place.removeprefix(RULE) for place in row.shown_by if place.startswith(RULE)]
        drawn = (
            ["all that are drawn"]
            if len(kinds) == len(KINDS)
            else [f"drawn: {'; '.join(kinds)}"]
            if kinds
            else []
        )
        lines.append(
            f"| {row.number} | {row.fault} | {row.bar} | {', '.join(tests + drawn)} | {row.result} |"
        )
    return "\n".join(lines)
