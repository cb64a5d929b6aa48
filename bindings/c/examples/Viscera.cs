// The C interface for C# and Unity. Put libviscera (viscera.dll, libviscera.so or libviscera.dylib) into
// Assets/Plugins, a model into Assets/StreamingAssets, and the component VisceraOrgan onto an object with a MeshFilter.
//
// It covers single touches, drawing and the guard; declare what else the header has likewise. Not run in Unity.
//
// Unity's axes are left-handed with y up: x_mesh = (x, z, y), a reflection. Every struct is blittable, so that a call
// neither copies nor allocates.
using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Viscera
{
    public enum Status
    {
        Ok = 0, BeyondDepth = 1, ErrorTooLarge = 2, OffSurface = 3, NotFinite = 4, NullPointer = 5, ShortBuffer = 6,
        BadModel = 7, BadSetting = 8, Stale = 9, Inside = 10, NotConverged = 11, OutOfTime = 12, Inverted = 13,
        Unstable = 14, Cancelled = 15
    }

    public enum GuardMode { Follows = 0, Limits = 1, Holds = 2, Fades = 3, Refuses = 4, Damps = 5 }

    [StructLayout(LayoutKind.Sequential)]
    public struct Vector
    {
        public double x, y, z;

        public Vector(double x, double y, double z) { this.x = x; this.y = y; this.z = z; }
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Matrix
    {
        public Vector row0, row1, row2;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Info
    {
        public ulong points;
        public ulong surface_nodes;
        public ulong surface_triangles;
        public ulong positions;
        public double radius;
        public double depth;
        public double edge_length;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Answer
    {
        public Vector force;
        public Matrix stiffness;
        public double error_estimate;
        public double shape_error_estimate;
        public Vector contact_point;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Frame
    {
        public double metres_per_unit;
        public double newtons_per_unit;
        public Matrix rotation;
        public Vector translation;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Guard
    {
        public double force_limit;
        public double rate_limit;
        public double watchdog;
        public double fade;
        public Vector force;
        public Vector target;
        public double age;
        public double fade_rate;
        public double energy_limit;
        public double damping;
        public double energy;
    }

    /// The functions of viscera.h.
    public static class Native
    {
        public const uint AbiVersion = 3;
        const string Library = "viscera";

        [DllImport(Library)]
        public static extern uint viscera_abi_version();
        [DllImport(Library)]
        public static extern Status viscera_load(byte[] bytes, UIntPtr len, out IntPtr model, byte[] message,
            UIntPtr message_len);
        [DllImport(Library)]
        public static extern void viscera_free(IntPtr model);
        [DllImport(Library)]
        public static extern Status viscera_info(IntPtr model, out Info info);
        [DllImport(Library)]
        public static extern void viscera_frame_identity(out Frame frame);
        [DllImport(Library)]
        public static extern Status viscera_set_frame(IntPtr model, in Frame frame);
        [DllImport(Library)]
        public static extern Status viscera_locate(IntPtr model, in Vector point, out Vector contact_point,
            out double distance);
        [DllImport(Library)]
        public static extern Status viscera_evaluate(IntPtr model, in Vector point, in Vector displacement,
            out Answer answer);
        [DllImport(Library)]
        public static extern UIntPtr viscera_workspace_size(IntPtr model);
        [DllImport(Library)]
        public static extern Status viscera_surface(IntPtr model, in Vector point, in Vector displacement,
            float[] workspace, UIntPtr workspace_len, float[] positions, UIntPtr positions_len);
        [DllImport(Library)]
        public static extern Status viscera_surface_topology(IntPtr model, uint[] triangles, UIntPtr triangles_len,
            uint[] nodes, UIntPtr nodes_len);
        [DllImport(Library)]
        public static extern Status viscera_guard_init(out Guard guard, double force_limit, double rate_limit,
            double watchdog, double fade);
        [DllImport(Library)]
        public static extern Status viscera_guard_keep_passive(ref Guard guard, double energy_limit, double damping);
        [DllImport(Library)]
        public static extern GuardMode viscera_guard_step_moved(ref Guard guard, in Vector force_in, Status status,
            in Vector moved, double dt, out Vector force_out);
    }

    /// A loaded model in Unity's axes, with the memory it draws into.
    public sealed class Organ : IDisposable
    {
        IntPtr handle;
        readonly float[] workspace;

        /// Positions of the surface nodes, three numbers each, and triangles between them.
        public readonly float[] Positions;
        public readonly uint[] Triangles;
        public readonly Info Info;

        public Organ(byte[] file)
        {
            if (Native.viscera_abi_version() != Native.AbiVersion)
                throw new NotSupportedException("libviscera and Viscera.cs are of different versions");
            var message = new byte[256];
            var length = (UIntPtr)(ulong)file.Length;
            if (Native.viscera_load(file, length, out handle, message, (UIntPtr)(ulong)message.Length) != Status.Ok)
                throw new FormatException(Encoding.UTF8.GetString(message, 0, Array.IndexOf(message, (byte)0)));
            Native.viscera_frame_identity(out Frame frame);
            frame.rotation.row1 = new Vector(0, 0, 1);
            frame.rotation.row2 = new Vector(0, 1, 0);
            Native.viscera_set_frame(handle, frame);
            Native.viscera_info(handle, out Info);
            workspace = new float[(int)Native.viscera_workspace_size(handle)];
            Positions = new float[3 * (int)Info.surface_nodes];
            Triangles = new uint[3 * (int)Info.surface_triangles];
            Native.viscera_surface_topology(handle, Triangles, (UIntPtr)(ulong)Triangles.Length, null, UIntPtr.Zero);
            Draw(new Vector(0, 0, 0), new Vector(0, 0, 0));
        }

        public void Dispose()
        {
            Native.viscera_free(handle);
            handle = IntPtr.Zero;
        }

        /// The touchable point closest to a place.
        public Status Locate(Vector at, out Vector contact, out double distance)
        {
            return Native.viscera_locate(handle, at, out contact, out distance);
        }

        /// Force of the tool on the organ; the hand feels its negative.
        public Status Touch(Vector contact, Vector displacement, out Answer answer)
        {
            return Native.viscera_evaluate(handle, contact, displacement, out answer);
        }

        /// Writes the deformed surface into Positions.
        public Status Draw(Vector contact, Vector displacement)
        {
            return Native.viscera_surface(handle, contact, displacement, workspace, (UIntPtr)(ulong)workspace.Length,
                                          Positions, (UIntPtr)(ulong)Positions.Length);
        }
    }

#if UNITY_5_3_OR_NEWER
    /// Draws an organ that the object `tool` presses: a contact sticks until the tool is pulled off again.
    public sealed class VisceraOrgan : UnityEngine.MonoBehaviour
    {
        public string file = "liver.viscera";
        public UnityEngine.Transform tool;
        public double forceLimit = 3;
        public UnityEngine.Vector3 ForceOnHand { get; private set; }

        Organ organ;
        Guard guard;
        UnityEngine.Mesh mesh;
        UnityEngine.Vector3[] vertices;
        Vector contact, outward, last;
        bool touches;

        void Start()
        {
            var path = System.IO.Path.Combine(UnityEngine.Application.streamingAssetsPath, file);
            organ = new Organ(System.IO.File.ReadAllBytes(path));
            Native.viscera_guard_init(out guard, forceLimit, 100, 0.2, 0.2);
            Native.viscera_guard_keep_passive(ref guard, 0.01, 2);
            vertices = new UnityEngine.Vector3[organ.Positions.Length / 3];
            mesh = new UnityEngine.Mesh { indexFormat = UnityEngine.Rendering.IndexFormat.UInt32 };
            GetComponent<UnityEngine.MeshFilter>().mesh = mesh;
            Show();
            mesh.triangles = Array.ConvertAll(organ.Triangles, i => (int)i);
            last = Here();
        }

        // Unity's own rate, too slow for a motor: a haptic loop calls Organ.Touch from a thread of its own.
        void FixedUpdate()
        {
            Vector at = Here(), moved = new Vector(at.x - last.x, at.y - last.y, at.z - last.z);
            last = at;
            double distance = 0;
            if (!touches) organ.Locate(at, out contact, out distance);
            var away = new Vector(at.x - contact.x, at.y - contact.y, at.z - contact.z);
            touches = outward.x * away.x + outward.y * away.y + outward.z * away.z < 0;
            if (!touches && distance > 0)
                outward = new Vector(away.x / distance, away.y / distance, away.z / distance);
            var answer = new Answer();
            var status = touches ? organ.Touch(contact, away, out answer) : Status.OffSurface;
            var dt = UnityEngine.Time.fixedDeltaTime;
            Native.viscera_guard_step_moved(ref guard, answer.force, status, moved, dt, out Vector force);
            ForceOnHand = transform.TransformDirection(-(float)force.x, -(float)force.y, -(float)force.z);
            organ.Draw(contact, touches ? away : new Vector(0, 0, 0));
        }

        void Update() { Show(); }

        void OnDestroy() { organ?.Dispose(); }

        Vector Here()
        {
            var p = transform.InverseTransformPoint(tool.position);
            return new Vector(p.x, p.y, p.z);
        }

        void Show()
        {
            for (int k = 0; k < vertices.Length; k++)
                vertices[k].Set(organ.Positions[3 * k], organ.Positions[3 * k + 1], organ.Positions[3 * k + 2]);
            mesh.vertices = vertices;
            mesh.RecalculateNormals();
        }
    }
#endif
}
