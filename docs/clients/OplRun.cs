// Run a job on the service of opl: OplRun ADDRESS FOLDER OUT. Nothing but the class library.
// mcs -r:System.Net.Http.dll OplRun.cs && mono OplRun.exe http://127.0.0.1:8765 part programs
using System;
using System.IO;
using System.Net.Http;
using System.Text.RegularExpressions;
using System.Threading;

static class OplRun
{
    static string Field(string json, string name) =>
        Regex.Match(json, "\"" + name + "\": ?\"((?:[^\"\\\\]|\\\\.)*)\"").Groups[1].Value;

    static int Main(string[] args)
    {
        var web = new HttpClient { BaseAddress = new Uri(args[0]) };
        var form = new MultipartFormDataContent { { new StringContent("run"), "task" } };
        var folder = Path.GetFullPath(args[1]) + Path.DirectorySeparatorChar;
        foreach (var path in Directory.GetFiles(folder, "*", SearchOption.AllDirectories))
            form.Add(new ByteArrayContent(File.ReadAllBytes(path)), "files",
                     path.Substring(folder.Length).Replace('\\', '/'));
        var job = web.PostAsync("/v1/jobs", form).Result.Content.ReadAsStringAsync().Result;
        var id = Field(job, "id");
        if (id == "") { Console.Error.WriteLine(job); return 2; }  // refused: where and message
        while (Field(job, "state") == "queued" || Field(job, "state") == "running")
        {
            Thread.Sleep(300);
            job = web.GetStringAsync("/v1/jobs/" + id).Result;
            Console.WriteLine(Field(job, "state") + " " + Field(job, "stage"));
        }
        if (Field(job, "status") != "ok") { Console.Error.WriteLine(Field(job, "message").Replace("\\n", "\n")); return 3; }
        Directory.CreateDirectory(args[2]);
        foreach (Match file in Regex.Matches(job, "\"url\": ?\"([^\"]*/files/([^\"]*))\""))
            File.WriteAllBytes(Path.Combine(args[2], Uri.UnescapeDataString(file.Groups[2].Value)),
                               web.GetByteArrayAsync(file.Groups[1].Value).Result);
        return 0;
    }
}
