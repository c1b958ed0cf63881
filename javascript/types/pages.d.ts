// Types that only the pages' JavaScript uses: messages of the WebSocket, and documents that a page route makes by hand.

type JobEvent = Api.AnswerTo<"GET", ["", "jobs", string, "events"]>[number];
type ResultBlock = Api.ResultEvent["blocks"][number];

/** A plot or a picture of a page, in addition to the blocks of events (rid_daq/workbench/block_routes.py). */
type PageBlock = ResultBlock
  | { kind: "plot"; name: string; caption: string; number: number }
  | { kind: "picture"; name: string; caption: string; images: PageImage[] };

interface PageImage {
  text: string;
  width: number;
  height: number;
  number: number;
}

/** A job of a kind with the values for programs of its result, if it has one. */
type JobOf<Kind extends Api.JobKind> = Omit<Api.Job, "kind"> & { kind: Kind; document?: Api.Results[Kind] };
type EndedJob = { [Kind in Api.JobKind]: JobOf<Kind> }[Api.JobKind];

/** Live values of a motion (rid_daq/live/picture.py); a job that reads the drives at rest sends fewer. */
interface LivePicture {
  age_s: number | null;
  at_rest_s: number | null;
  base_wrench?: LiveWrench | null;
  cell: string;
  count: string;
  drives_off: boolean;
  joints: LiveJoint[];
  left_s: number | null;
  moving: boolean;
  notes: string[];
  over: boolean;
  phase: string;
  problem: string | null;
  recorder: string;
  robot: string;
  share: number | null;
  state: string;
  stop: string | null;
  stop_asked: boolean;
  stop_joint: string | null;
  title: string;
  words: string;
}

interface LiveJoint {
  answers: boolean | null;
  following_error: number | null;
  following_error_share: number | null;
  name: string;
  position: number | null;
  position_max: number;
  position_min: number;
  temperature_c: number | null;
  torque: number | null;
  torque_limit: number;
  torque_share: number | null;
  torque_unit: string;
  unit: string;
  velocity: number | null;
  velocity_limit: number;
}

/** Wrench of the base on the robot (rid_daq/live/base_wrench.py). */
interface LiveWrench {
  age_s: number | null;
  force_n: Vector;
  moment_nm: Vector;
  overloaded: boolean;
}

type Vector = [number, number, number];

/** Status of a cell; without the age of its preflight if only this age has changed. */
type SentStatus = Api.CellStatus | Omit<Api.CellStatus, "preflight_age_s">;

/** A message of the service on the WebSocket of a page (rid_daq/service/api/live_socket.py). */
type ServiceMessage =
  | { type: "cell"; cell: SentStatus }
  | { type: "job"; job: Api.Job }
  | { type: "event"; job: string; event: JobEvent; number: number }
  | { type: "samples"; cell: string; job: string; picture: LivePicture }
  | { type: "challenge"; job: string; value: string }
  | ({ type: "stopped"; number: number } & Api.StopAnswer)
  | { type: "beat" };

/** Values with which `service.js` calls the listeners of an event. */
interface ServiceEvents {
  again: [];
  cell: [status: Api.CellStatus];
  event: [job: string, event: JobEvent, number: number];
  job: [job: Api.Job];
  key: [job: string, why: string];
  reach: [reach: { values: boolean; requests: boolean }];
  samples: [picture: LivePicture, job: string];
  signals: [message: ArrayBuffer];
  stay: [];
}

/** A planned motion (rid_daq/workbench/view/motion_playback.py). */
interface MotionPlayback {
  approach: { source: string; at_s: number | null; problem: string };
  clearance: MotionClearance | null;
  deviation_m: number;
  deviation_rad: number;
  files_hash: string;
  is_accurate: boolean;
  path_m: Vector[];
  periods: number;
  phases: { start_s: number; name: string }[];
  position: number[][];
  times_s: number[];
}

interface MotionClearance {
  distance_m: number[];
  least_at_s: number;
  margin_m: number;
  pairs: string[];
  times_s: number[];
}

/** A pose that the 3-D view shows; `kind` is the colour of its words. */
interface ShownPose {
  position: number[] | null;
  words: string;
  kind: "live" | "old" | "planned";
  target?: number[] | null;
  wrench?: LiveWrench | null;
}

/** Head of a message with live signals (rid_daq/service/signals/signal_view.py). */
interface SignalsHead {
  type: "signals";
  age_s: number;
  bin_s: number;
  cell: string;
  cell_lanes: string[];
  count: number;
  first: number;
  joints: string[];
  key: string;
  lanes: string[];
  lost: number;
}

/** Acknowledgement of a stop request. */
interface StopAcknowledgement {
  number?: number;
  sent?: boolean;
  sentence?: string;
}

interface DocumentEventMap {
  "joint-chosen": CustomEvent<number | null>;
  "stop-answered": CustomEvent<StopAcknowledgement>;
  "stop-asked": CustomEvent<string>;
}

interface Window {
  endStop?: () => void;
}

/** Properties that the pages' scripts add to elements. */
interface Element {
  loading?: AbortController | null;
  takeOut?: () => void;
  robotView?: object;
  signals?: object;
}

/** Attributes and listeners ("onclick") for `element` of dom.js. */
type Attributes = Record<string, string | number | boolean | null | undefined | ((event: Event) => unknown)>;

type Control = HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement;

/** Ids of text fields. */
type InputId = { [Id in keyof PageElements]: PageElements[Id] extends HTMLInputElement ? Id : never }[keyof PageElements];

/** A part of a template of lit-html. */
type Part = unknown;

type PlotBlock = Extract<PageBlock, { kind: "plot" }>;
type PictureBlock = Extract<PageBlock, { kind: "picture" }>;

interface RequestLimits {
  patienceMs?: number;
  urgent?: boolean;
  signal?: AbortSignal | null;
}

/** A message with a held or tapped key. */
/** Part of a text on a page; with an address it is a link. */
interface PageWords {
  words: string;
  address?: string;
  isCode?: boolean;
}

interface KeyMessage {
  job: string;
  held?: string;
  tapped?: string;
  sequence: number;
  challenge?: string;
}

interface HoldPad {
  pad: HTMLElement;
  leave: () => void;
}

/** The functions of a 3-D view that plays a motion (planned_view.js). */
interface PlannedView {
  reload: (how?: { isSame?: boolean }) => Promise<void>;
  refuse: (words: string) => void;
  showPose: (position: number[]) => void;
  side: HTMLElement;
  knownPose: () => number[] | null;
}

/** Form of a kind of motion that is made from poses (pose_builder.js). */
interface PoseForm {
  label: string;
  hint: string;
  settings: PoseSetting[];
}

interface PoseSetting {
  key: string;
  label: string;
  initial: number | number[];
  factor: number;
  choices: [string, number | number[]][];
}

interface RunTableOptions {
  pick?: ((event: Event) => void) | null;
  picked?: string[];
  opened?: Set<string>;
  fold?: ((id: string) => void) | null;
  cells?: boolean;
}

/** A rectangle on the screen [px]. */
interface Box {
  left: number;
  right: number;
  top: number;
  bottom: number;
}

/** Functions that a page gives to the panel of a job (job_panel.js). */
interface JobPanelOptions {
  next?: (job: EndedJob) => Part[];
  begun?: (job: Api.Job) => unknown;
  ended?: (job: EndedJob) => unknown;
  heard?: (event: JobEvent, job: Api.Job) => void;
  places?: { [Kind in Api.JobKind]?: HTMLElement };
  isBelow?: (job: EndedJob) => boolean;
}

/** State of the panel for one job. */
interface JobView {
  begin: { title: string; done: number; at_s: number } | null;
  ahead: Map<number, JobEvent>;
  blocks?: ResultBlock[];
  count: string;
  document?: Record<string, unknown>;
  end?: { kind: string; words: string };
  estimate: string;
  isFailureShown: boolean;
  known: number;
  last: string;
  left: string;
  links: Part[];
  loading: Promise<void> | null;
  log: import("../../rid_daq/workbench/static/job_log.js").JobLog;
  over: boolean;
  pad: HoldPad | null;
  problem: string;
  question: Api.QuestionEvent | null;
  recent: string[];
  results: Part[];
  share: number | null;
  verdicts: Part[];
  words: string;
}

/** The running job, or the last job's end with the next step (now_next.js). */
interface NowNext {
  isRunning: boolean;
  kind?: string;
  words: string;
  count?: string;
  left?: string;
  share?: number | null;
  steps: Part[];
}

type Four = [number, number, number, number];
type Sixteen = [...Four, ...Four, ...Four, ...Four];

/** Ids of selection fields. */
type SelectId = { [Id in keyof PageElements]: HTMLSelectElement extends PageElements[Id] ? Id : never }[keyof PageElements];

/** Settings of an interrupted payload session: its whole request. */
type SessionChoices = Required<Api.Requests["payload_session"]> & { limits: Required<Api.Request_payload_session_VerdictLimits> };

type JointKind = Api.JointDocument["kind"];
type SignalJoint = { name: string; kind: JointKind };
type uPlot = import("uplot");

/** A chart of live signals; `joints` contains the indices of its joints (null: a signal of the cell). */
interface SignalChart {
  title: string;
  unit: string;
  low: string;
  high: string;
  factor: number;
  joints: number[] | null;
  isFromZero?: boolean;
}

/** A press of STOP that the service has not acknowledged yet. */
interface StopPress {
  number: number;
  cell: string;
  request: string;
  at: number;
}

type StopLine = WebSocket & { heardAt: number };

/** The parts of a joint on the live page. */
type JointCard = { article: HTMLElement; points: [number, number, number | null][] } & Record<
  "name" | "temperature" | "torque" | "torque-bar" | "torque-soft" | "error" | "error-bar" | "error-soft" | "position"
  | "position-mark" | "low" | "high" | "velocity" | "velocity-mark" | "slow" | "fast" | "canvas", HTMLElement>;

declare module "*.css";
